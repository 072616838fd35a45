from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.dataset.reader import Dataset
from mitsuba_endo.errors import InputError
from mitsuba_endo.learn.samples import Samples
from tests.dataset.small import make_here, small_config

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module", params=["files", "hdf5"])
def folder(request, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("samples") / request.param
    make_here(small_config(format=request.param), out, 3)
    return out


def test_a_loader_gives_batches_of_what_is_stored(folder: Path):
    """Oracle: the arrays as the dataset's own reader gives them."""
    loader = torch.utils.data.DataLoader(Samples(folder), batch_size=2)
    first = next(iter(loader))
    stored = Dataset(folder)[1].arrays
    assert first["index"].tolist() == [0, 1]
    assert first["image"].shape == (2, 3, 30, 40)
    np.testing.assert_array_equal(
        (255 * first["image"][1].numpy()).round(), np.moveaxis(stored["image"], -1, 0)
    )
    for name in ("q", "phase", "node", "normals"):
        np.testing.assert_array_equal(first[name][1].numpy(), np.moveaxis(stored[name], -1, 0))
    for name in ("code", "visible", "shadow", "camera", "mixed"):
        np.testing.assert_array_equal(first[name][1].numpy(), stored[name])
    np.testing.assert_array_equal(first["depth"][1, 0].numpy(), stored["depth"])
    assert len(list(loader)) == 2


def test_worker_processes_of_a_loader_read_too(folder: Path):
    """Oracle: the same items without worker processes."""
    samples = Samples(folder, names=("image", "index"))
    loader = torch.utils.data.DataLoader(
        samples, num_workers=1, multiprocessing_context="spawn", batch_size=None
    )
    read = list(loader)
    assert [item["index"] for item in read] == [0, 1, 2]
    assert torch.equal(read[2]["image"], samples[2]["image"])


def test_names_and_transform_choose_what_an_item_is(folder: Path):
    """Oracle: the keys; the transform's result."""
    assert set(Samples(folder, names=("q", "visible"))[0]) == {"q", "visible"}
    assert Samples(folder, transform=lambda item: item["index"])[-1] == 2
    with pytest.raises(IndexError):
        Samples(folder)[3]
    with pytest.raises(InputError, match="the samples have no 'albedo'"):
        Samples(folder, names=("albedo",))[0]


def test_a_folder_without_a_dataset_is_refused(tmp_path: Path):
    """Oracle: the missing file's name."""
    with pytest.raises(InputError, match=r"holds no dataset\.json"):
        Samples(tmp_path)
