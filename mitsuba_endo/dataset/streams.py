"""Random numbers that depend on the dataset's seed and the sample's number and nothing else."""

import zlib

import numpy as np


def stream(seed: int, name: str, *numbers: int) -> np.random.Generator:
    """Return the generator of one purpose, e.g. ``stream(seed, "pose", sample)``.

    Streams of different names or numbers are independent (``SeedSequence`` spawn keys), so that a
    sample is the same whichever process makes it, and however many numbers other purposes take.
    """
    key = (zlib.crc32(name.encode()), *numbers)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
