"""Running the network that comes with the package, with either engine and at any size."""

from importlib.resources import files

import numpy as np
import pytest

from mitsuba_endo.decode.grid.heads import CHANNELS
from mitsuba_endo.decode.grid.network import Network, load_network
from mitsuba_endo.decode.grid.onnx_metadata import metadata
from mitsuba_endo.errors import InputError
from tests.decode.grid_views import photo, view

WEIGHTS = (files("mitsuba_endo.decode") / "weights" / "decoder.onnx").read_bytes()


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


def test_the_metadata_names_the_channels():
    """Oracle: the contract between training and decoding."""
    assert sorted(metadata(WEIGHTS)["channels"].split(",")) == sorted(CHANNELS)


@pytest.mark.parametrize("data", [b"", b"not a network", WEIGHTS[:1000], bytes(range(256)) * 9])
def test_damaged_weights(data: bytes):
    """Oracle: none of these holds the channels' names."""
    assert metadata(data) == {}
    with pytest.raises(InputError, match=r"some.onnx: is not a decoder network"):
        Network(data, "some.onnx")


def test_weights_cut_short():
    """Oracle: a file whose head is whole and whose end is missing is refused, not run."""
    broken = WEIGHTS[: len(WEIGHTS) // 2] + WEIGHTS[-400:]
    with pytest.raises(InputError):
        Network(broken, "some.onnx")
