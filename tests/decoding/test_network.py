"""Running the network that comes with the package, with either engine and at any size."""

import hashlib
import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.decoding.network import CHANNELS, Network, load_network
from mitsuba_endo.errors import InputError
from tests.decoding.grid_views import photo, view

SHIPPED = Path(str(files("mitsuba_endo.decoding"))) / "weights" / "decoder.onnx"
WEIGHTS = SHIPPED.read_bytes()


@pytest.mark.parametrize("size", [(250, 333), (176, 240), (16, 48), (33, 7)])
def test_engines_agree(llvm, size: tuple[int, int]):
    """Oracle: ONNX Runtime and OpenCV are two implementations; sizes that are padded or not."""
    pytest.importorskip("onnxruntime")
    image = photo(view("colon"))[20 : 20 + size[0], 30 : 30 + size[1]]
    one, other = (load_network(engine=e).heads(image) for e in ("onnxruntime", "opencv"))
    assert one.phase.shape == (*size, 2)
    np.testing.assert_allclose(one.confidence, other.confidence, atol=1e-4)
    np.testing.assert_allclose(one.edge, other.edge, atol=1e-4)
    np.testing.assert_allclose(one.code, other.code, atol=1e-4)
    sure = one.confidence > 0.5
    away = (one.phase - other.phase)[sure]
    np.testing.assert_allclose(away - np.rint(away), 0, atol=1e-4)


def test_kinds_of_images(llvm):
    """Oracle: the same light as 8 bits, 16 bits, floats and three equal channels."""
    network = load_network()
    image = photo(view("sheet"))
    expected = network.heads(image)
    for same in (image.astype(np.uint16) * 257, image / 255, np.repeat(image[..., None], 3, -1)):
        np.testing.assert_allclose(network.heads(same).confidence, expected.confidence, atol=1e-3)


def test_the_description_names_the_channels():
    """Oracle: the contract between training and decoding; the file's own checksum."""
    description = json.loads(SHIPPED.with_suffix(".json").read_text("utf-8"))
    assert sorted(description["channels"]) == sorted(CHANNELS)
    assert description["sha256"] == hashlib.sha256(WEIGHTS).hexdigest()


def test_weights_without_description(tmp_path: Path):
    """Oracle: the file that is missing is named; weights alone do not say what they return."""
    (tmp_path / "own.onnx").write_bytes(WEIGHTS)
    with pytest.raises(InputError, match=r"own.json beside it is missing"):
        load_network(tmp_path / "own.onnx")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"channels": 3, "sha256": ""}', "\udcff"])
def test_damaged_descriptions(text: str, tmp_path: Path):
    """Oracle: none of these names channels."""
    (tmp_path / "own.onnx").write_bytes(WEIGHTS)
    (tmp_path / "own.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=r"describes none"):
        load_network(tmp_path / "own.onnx")


@pytest.mark.parametrize("data", [b"", b"not a network", WEIGHTS[:1000], WEIGHTS[:-1]])
def test_damaged_weights(data: bytes, tmp_path: Path):
    """Oracle: the checksum is of the whole file, so no engine sees a damaged one."""
    (tmp_path / "own.onnx").write_bytes(data)
    (tmp_path / "own.json").write_text(SHIPPED.with_suffix(".json").read_text("utf-8"))
    with pytest.raises(InputError, match=r"own.onnx: is not what own.json describes"):
        load_network(tmp_path / "own.onnx")


def test_weights_that_no_engine_reads():
    """Oracle: a file whose head is whole and whose end is missing is refused, not run."""
    broken = WEIGHTS[: len(WEIGHTS) // 2] + WEIGHTS[-400:]
    with pytest.raises(InputError):
        Network(broken, CHANNELS, "some.onnx")
