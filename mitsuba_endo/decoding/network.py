"""The decoder network: its weights, running it with ONNX Runtime or OpenCV, what it says."""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading.regular import NETWORK, read_bytes
from ..reading.trees import read_json
from .apart import ApartNetwork
from .normalise import normalise

CHANNELS = (
    "sin_u", "cos_u", "sin_v", "cos_v", "code_R", "code_S", "code_L", "confidence", "edge",
)  # fmt: skip
CODES = (1, 0, -1)
"""Codes in the order of their channels: R, S, L."""
STRIDE = 16
"""Pixels; height and width of the network's input are multiples of it: four halvings."""
LEAST_SIDE = 32
"""Pixels, of height and width: OpenCV 5.0 convolves features of one row or column to rubbish."""
Engine = Literal["onnxruntime", "opencv"]


@dataclass(frozen=True, eq=False)
class Heads:
    """The network's outputs with their units."""

    phase: NDArray[np.float32]
    """(H, W, 2) place within the grid's period along x and y, periods in [-1/2, 1/2]."""
    code: NDArray[np.float32]
    """(3, H, W) probabilities of R, S, L, meant near nodes."""
    confidence: NDArray[np.float32]
    """(H, W) probability that the pixel is lit and its phase right."""
    edge: NDArray[np.float32]
    """(H, W) probability that the pixel lies on a depth edge."""


def read_heads(output: NDArray[np.float32], channels: Sequence[str]) -> Heads:
    """Return the heads of a network's output (K, H, W), whose channels have these names.

    Raises:
        InputError: a channel is missing.
    """
    missing = [name for name in CHANNELS if name not in channels]
    if missing or len(channels) != len(output):
        what = f"output {missing[0]} is missing" if missing else f"has {len(output)} outputs"
        raise InputError(what, "decoder network", "use the weights of this version")
    at = {name: output[channels.index(name)] for name in CHANNELS}
    turns = [np.arctan2(at[f"sin_{axis}"], at[f"cos_{axis}"]) / (2 * np.pi) for axis in "uv"]
    logits = np.stack([at[f"code_{letter}"] for letter in "RSL"])
    exponential = np.exp(logits - logits.max(0))
    return Heads(
        phase=np.stack(turns, -1).astype(np.float32),
        code=exponential / exponential.sum(0),
        confidence=_sigmoid(at["confidence"]),
        edge=_sigmoid(at["edge"]),
    )


def _sigmoid(logit: NDArray[np.float32]) -> NDArray[np.float32]:
    return (0.5 + 0.5 * np.tanh(0.5 * logit)).astype(np.float32)


class _Runner(Protocol):
    def __call__(self, x: NDArray[np.float32], /) -> NDArray[np.float32]: ...


class Network:
    """Trained weights, ready to be run on images of any size."""

    def __init__(
        self, weights: bytes, channels: Sequence[str], source: str, engine: Engine | None = None
    ) -> None:
        """Read the weights of an ONNX file.

        Args:
            weights: contents of the file.
            channels: names of its outputs, in order.
            source: its name, for messages.
            engine: default ONNX Runtime if it is installed (the extra ``decode``), else OpenCV,
                which takes about twice as long.

        Raises:
            InputError: no network, or ONNX Runtime is asked for and not installed.
        """
        self.engine: Engine = engine or default_engine()
        self._channels = channels
        if self.engine == "onnxruntime" and not find_spec("onnxruntime"):
            raise InputError(
                "ONNX Runtime is not installed", source, 'pip install "mitsuba-endo[decode]"'
            )
        shipped = _checksum(weights) == _checksum(_shipped())
        # Foreign weights can end the process that runs them.
        self._run: _Runner = (
            loader(self.engine)(weights) if shipped else ApartNetwork(weights, source, self.engine)
        )

    def heads(self, image: NDArray[np.integer] | NDArray[np.floating]) -> Heads:
        """Return what the network says of an image (H, W) or (H, W, 3); see :func:`normalise`.

        Raises:
            InputError: not an image.
        """
        return self.heads_of_input(normalise(image))

    def heads_of_input(self, x: NDArray[np.float32]) -> Heads:
        """Return the same for an image that is normalised already, (2, H, W)."""
        height, width = x.shape[1:]
        below, beside = (max(-n % STRIDE, LEAST_SIDE - n) for n in (height, width))
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

    Its description, :func:`describe`'s, lies beside it in a JSON file of the same name.

    Raises:
        InputError: no such file, no description beside it, or weights that it does not describe.
    """
    if path is None:
        with as_file(files("mitsuba_endo.decoding") / "weights") as folder:
            return load_network(folder / "decoder.onnx", engine)
    path = Path(path)
    weights = read_bytes(path, NETWORK, todo="give the decoder's ONNX file")
    return Network(weights, _channels(weights, path), str(path), engine)


def describe(weights: bytes, notes: dict[str, str]) -> str:
    """Return the JSON text that lies beside weights: outputs, input's multiple, checksum, notes."""
    values = {"channels": CHANNELS, "stride": STRIDE, "sha256": _checksum(weights), **notes}
    return json.dumps(values, indent=1) + "\n"


def _checksum(weights: bytes) -> str:
    return hashlib.sha256(weights).hexdigest()


def _channels(weights: bytes, path: Path) -> list[str]:
    beside = path.with_suffix(".json")
    try:
        description = read_json(beside)
        channels, checksum = [str(name) for name in description["channels"]], description["sha256"]
    except (InputError, KeyError, TypeError):
        raise InputError(
            f"is not a decoder network: {beside.name} beside it is missing or describes none",
            str(path), "give the file that scripts/train_decoder.py wrote, with its JSON",
        ) from None  # fmt: skip
    if checksum != _checksum(weights):
        raise InputError(f"is not what {beside.name} describes", str(path), "copy both again")
    return channels


def default_engine() -> Engine:
    """Return ONNX Runtime if it is installed, else OpenCV."""
    return "onnxruntime" if find_spec("onnxruntime") else "opencv"


def loader(engine: str) -> Callable[[bytes], _Runner]:
    """Return the function that loads weights into an engine; it raises whatever that raises."""
    return {"onnxruntime": _onnxruntime, "opencv": _opencv}[engine]


def _shipped() -> bytes:
    return (files("mitsuba_endo.decoding") / "weights" / "decoder.onnx").read_bytes()


def _onnxruntime(weights: bytes) -> _Runner:
    ort: Any = import_module("onnxruntime")
    options = ort.SessionOptions()
    # Its own default counts the machine's cores, also those that this process may not use.
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    options.intra_op_num_threads = usable or 1
    options.log_severity_level = 3
    session = ort.InferenceSession(weights, options, providers=["CPUExecutionProvider"])
    name = session.get_inputs()[0].name
    return lambda x: session.run(None, {name: x})[0]


def _opencv(weights: bytes) -> _Runner:
    net = cv2.dnn.readNetFromONNX(np.frombuffer(weights, np.uint8))

    def run(x: NDArray[np.float32], /) -> NDArray[np.float32]:
        net.setInput(x)
        return np.asarray(net.forward(), np.float32)

    return run
