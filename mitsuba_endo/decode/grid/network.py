"""The decoder network: its weights, and running it with ONNX Runtime or OpenCV."""

import os
from collections.abc import Sequence
from importlib import import_module
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..normalise import normalise
from .heads import Heads, read_heads
from .onnx_metadata import metadata

STRIDE = 16
"""Height and width of the network's input are multiples of it."""
LEAST = 32
"""Least height and width: OpenCV 5.0 convolves features of one row or column to rubbish."""
Engine = Literal["onnxruntime", "opencv"]


class _Runner(Protocol):
    def __call__(self, x: NDArray[np.float32], /) -> NDArray[np.float32]: ...


class Network:
    """Trained weights, ready to be run on images of any size."""

    def __init__(self, weights: bytes, source: str, engine: Engine | None = None) -> None:
        """Read the weights of an ONNX file.

        Args:
            weights: contents of the file.
            source: its name, for messages.
            engine: default ONNX Runtime if it is installed (the extra ``decode``), else OpenCV,
                which takes about twice as long.

        Raises:
            InputError: not a decoder network, or ONNX Runtime is asked for and not installed.
        """
        self.engine: Engine = engine or default_engine()
        self._channels: Sequence[str] = _channels(weights, source)
        load = {"onnxruntime": _onnxruntime, "opencv": _opencv}[self.engine]
        self._run = load(weights, source)

    def heads(self, image: NDArray[np.integer] | NDArray[np.floating]) -> Heads:
        """Return what the network says of an image (H, W) or (H, W, 3); see :func:`normalise`.

        Raises:
            InputError: not an image.
        """
        return self.heads_of_input(normalise(image))

    def heads_of_input(self, x: NDArray[np.float32]) -> Heads:
        """Return the same for an image that is normalised already, (2, H, W)."""
        height, width = x.shape[1:]
        below, beside = (max(-n % STRIDE, LEAST - n) for n in (height, width))
        padded = np.pad(x, ((0, 0), (0, below), (0, beside)), mode="edge")
        output = self._run(np.ascontiguousarray(padded[None]))
        expected = (1, len(self._channels), *padded.shape[1:])
        if output.shape != expected:
            raise InputError(
                f"returned {output.shape} instead of {expected}",
                f"decoder network ({self.engine})",
                'install the other engine with pip install "mitsuba-endo[decode]"',
            )  # fmt: skip
        return read_heads(output[0, :, :height, :width], self._channels)


def load_network(path: str | Path | None = None, engine: Engine | None = None) -> Network:
    """Return the network of an ONNX file, by default the one that comes with the package.

    Raises:
        InputError: no such file, or not a decoder network.
    """
    if path is None:
        with as_file(files("mitsuba_endo.decode") / "weights" / "decoder.onnx") as inside:
            return load_network(inside, engine)
    path = Path(path)
    if not path.is_file():
        raise InputError("no such file", str(path), "give the decoder's ONNX file")
    return Network(path.read_bytes(), str(path), engine)


def default_engine() -> Engine:
    """Return ONNX Runtime if it is installed, else OpenCV."""
    return "onnxruntime" if find_spec("onnxruntime") else "opencv"


def _channels(weights: bytes, source: str) -> list[str]:
    names = metadata(weights).get("channels")
    if not names:
        raise InputError("is not a decoder network", source, "give the decoder's ONNX file")
    return [name.strip() for name in names.split(",")]


def _onnxruntime(weights: bytes, source: str) -> _Runner:
    if not find_spec("onnxruntime"):
        raise InputError(
            "ONNX Runtime is not installed", source, 'pip install "mitsuba-endo[decode]"'
        )
    ort: Any = import_module("onnxruntime")
    options = ort.SessionOptions()
    # Its own default counts the machine's cores, also those that this process may not use.
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    options.intra_op_num_threads = usable or 1
    options.log_severity_level = 3
    try:
        session = ort.InferenceSession(weights, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # its exceptions have no common class of their own
        raise InputError(f"cannot be loaded ({error})", source, "make it again") from None
    name = session.get_inputs()[0].name
    return lambda x: session.run(None, {name: x})[0]


def _opencv(weights: bytes, source: str) -> _Runner:
    try:
        net = cv2.dnn.readNetFromONNX(np.frombuffer(weights, np.uint8))
    except cv2.error:
        raise InputError("cannot be loaded by OpenCV", source, "install ONNX Runtime") from None

    def run(x: NDArray[np.float32], /) -> NDArray[np.float32]:
        net.setInput(x)
        return np.asarray(net.forward(), np.float32)

    return run
