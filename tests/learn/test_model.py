"""The network: shapes, and the same numbers from every program that runs it."""

import json

import cv2
import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")

from mitsuba_endo.decoding.network import CHANNELS, load_network  # noqa: E402
from mitsuba_endo.learn.export import export_onnx  # noqa: E402
from mitsuba_endo.learn.model import DecoderNet  # noqa: E402

SIZES = [(240, 320), (480, 640), (112, 208), (48, 64)]
"""Usual ones, and what images of odd sizes are padded to."""


@pytest.fixture(scope="module")
def network():
    """A network with random weights and running statistics as a trained one has."""
    torch.manual_seed(3)
    made = DecoderNet()
    for part in made.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            torch.nn.init.normal_(part.running_mean, std=0.3)
            torch.nn.init.uniform_(part.running_var, 0.5, 2)
    return made.eval()


@pytest.fixture(scope="module")
def exported(network, tmp_path_factory):
    path = tmp_path_factory.mktemp("onnx") / "net.onnx"
    export_onnx(network, path, {"seed": "3"})
    return path


def test_size_and_channels(network, exported):
    """Oracle: the model card's number of parameters; the names in the description beside it."""
    assert sum(p.numel() for p in network.parameters()) == 791_689
    description = json.loads(exported.with_suffix(".json").read_text("utf-8"))
    assert description["channels"] == list(CHANNELS)
    assert description["stride"] == 16
    assert description["seed"] == "3"
    assert exported.stat().st_size < 8e6


@pytest.mark.parametrize("size", SIZES)
def test_every_runtime_agrees(network, exported, size):
    """Oracle: PyTorch; 32-bit sums in another order differ by a few parts in a million."""
    image = np.random.default_rng(1).normal(size=(1, 2, *size)).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(image)).numpy()
    assert expected.shape == (1, len(CHANNELS), *size)
    session = onnxruntime.InferenceSession(exported, providers=["CPUExecutionProvider"])
    np.testing.assert_allclose(session.run(None, {"image": image})[0], expected, atol=2e-5)
    net = cv2.dnn.readNetFromONNX(str(exported))
    net.setInput(image)
    np.testing.assert_allclose(net.forward(), expected, atol=2e-5)


@pytest.mark.parametrize("size", [(9, 70), (16, 48), (33, 12)])
def test_small_images(exported, size):
    """Oracle: ONNX Runtime; OpenCV is wrong where features shrink to one row or column."""
    image = np.random.default_rng(3).integers(0, 255, size, dtype=np.uint8)
    pair = [load_network(exported, engine).heads(image) for engine in ("onnxruntime", "opencv")]
    assert pair[0].phase.shape == (*size, 2)
    np.testing.assert_allclose(pair[1].confidence, pair[0].confidence, atol=2e-5)
    away = pair[1].phase - pair[0].phase
    np.testing.assert_allclose(away - np.round(away), 0, atol=1e-3)


def test_opencv_changes_size_between_images(network, exported):
    """Oracle: PyTorch, on a second image of another size through the same OpenCV network."""
    net = cv2.dnn.readNetFromONNX(str(exported))
    rng = np.random.default_rng(2)
    for size in ((64, 96), (48, 160), (64, 96)):
        image = rng.normal(size=(1, 2, *size)).astype(np.float32)
        net.setInput(image)
        with torch.no_grad():
            expected = network(torch.from_numpy(image)).numpy()
        np.testing.assert_allclose(net.forward(), expected, atol=2e-5)
