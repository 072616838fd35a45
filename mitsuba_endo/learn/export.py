"""From a trained network to an ONNX file that runs without PyTorch."""

import copy
import warnings
from pathlib import Path

import onnx  # pyright: ignore[reportMissingImports]
import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]

from ..decoding.network import STRIDE, describe
from ..decoding.normalise import INPUT_CHANNELS
from ..files import atomic_path

OPSET = 17
"""Read by onnxruntime from 1.12 and by OpenCV."""


def export_onnx(network: nn.Module, path: Path, notes: dict[str, str]) -> None:
    """Write the network as ONNX: ``image`` (1, 2, H, W) to ``heads`` (1, 9, H, W), any H and W
    that are multiples of 16.

    Beside it, in a JSON file of the same name, lies what ``decode.network.describe`` says of it.

    Raises:
        InputError: a file cannot be written.
    """
    still = copy.deepcopy(network).to("cpu").float().eval()
    example = torch.zeros(1, INPUT_CHANNELS, 4 * STRIDE, 6 * STRIDE)
    sizes = {2: "height", 3: "width"}
    with atomic_path(path) as aside:
        with warnings.catch_warnings():
            # The successor rewrites the graph into operations that OpenCV does not know.
            warnings.simplefilter("ignore", DeprecationWarning)
            torch.onnx.export(
                still, (example,), aside, input_names=["image"], output_names=["heads"],
                dynamic_axes={"image": sizes, "heads": sizes}, opset_version=OPSET, dynamo=False,
            )  # fmt: skip
        onnx.checker.check_model(onnx.load(aside))
        description = describe(Path(aside).read_bytes(), notes)
    with atomic_path(path.with_suffix(".json")) as aside:
        Path(aside).write_text(description, "utf-8")
