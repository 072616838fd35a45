"""A process that tries spoilt files, one after the other, and says how each ended.

Its stdin holds ``READER SEED`` on each line; it answers every line with one of JSON.
"""

import json
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
import zlib
from pathlib import Path

import numpy as np

from .reader import Reader
from .readers import READERS


def attempt(reader: Reader, seed: int, folder: Path) -> dict[str, object]:
    """Spoil a reader's file and let it be read; say how that ended."""
    from mitsuba_endo.errors import InputError

    reader.make(folder)
    path = folder / reader.file
    how, spoilt = spoil(reader, seed, path.read_bytes())
    path.write_bytes(spoilt)
    started, busy = time.monotonic(), time.process_time()
    result: dict[str, object] = {"reader": reader.name, "seed": seed, "how": how}
    try:
        reader.use(folder)
        result["ended"] = "read"
    except InputError as error:
        result |= {"ended": "refused", "said": str(error)}
        if "\n" in str(error) or len(str(error)) > 1500:
            result["ended"] = "fault"
    except BaseException as error:  # what nobody expected is what is looked for
        where = traceback.format_exc().splitlines()[-6:]
        result |= {"ended": "fault", "said": f"{type(error).__name__}: {error}"[:600]}
        result["where"] = where
    seconds, cpu = time.monotonic() - started, time.process_time() - busy
    return result | {"seconds": seconds, "cpu": cpu}


def spoil(reader: Reader, seed: int, data: bytes) -> tuple[str, bytes]:
    """Return how a file is spoilt for a seed, and its contents then."""
    rng = np.random.default_rng((zlib.crc32(reader.name.encode()), seed))
    way = reader.ways[int(rng.integers(len(reader.ways)))]
    return way.__name__, way(data, rng)


def main() -> None:
    """Try what comes in."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    for line in sys.stdin:
        name, _, seed = line.strip().rpartition(" ")
        aside = Path(tempfile.mkdtemp(prefix="attempt-"))
        try:
            result = attempt(READERS[name], int(seed), aside / "in")
        finally:
            shutil.rmtree(aside, ignore_errors=True)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(json.dumps(result | {"peak_mib": round(peak)}), file=answers, flush=True)


if __name__ == "__main__":
    main()
