import pickle
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.dataset.reader import Dataset
from mitsuba_endo.errors import InputError
from tests.dataset.small import make_here, small_config


@pytest.fixture(scope="module", params=["files", "hdf5"])
def folder(request, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("samples") / request.param
    make_here(small_config(format=request.param), out, 3)
    return out


def test_a_dataset_gives_samples_by_position_in_any_process(folder: Path):
    """Oracle: the samples' numbers, and equal arrays of a dataset that was sent and unpacked."""
    dataset = Dataset(folder)
    assert [sample.description["index"] for sample in dataset] == [0, 1, 2]
    sent = pickle.loads(pickle.dumps(dataset))
    assert len(sent) == 3
    for name, array in dataset[2].arrays.items():
        np.testing.assert_array_equal(sent[2].arrays[name], array)


def test_pytorchs_loader_takes_a_dataset(folder: Path):
    """Oracle: the arrays themselves, stacked as the documentation's example does."""
    torch = pytest.importorskip("torch")

    def batch(samples):
        return torch.from_numpy(np.stack([sample.arrays["q"] for sample in samples]))

    dataset = Dataset(folder)
    first, last = torch.utils.data.DataLoader(dataset, batch_size=2, collate_fn=batch)
    assert first.shape == (2, 30, 40, 2)
    np.testing.assert_array_equal(last[0].numpy(), dataset[2].arrays["q"])


def test_a_folder_without_a_dataset_is_refused(tmp_path: Path):
    """Oracle: the missing file's name."""
    with pytest.raises(InputError, match=r"holds no dataset\.json"):
        Dataset(tmp_path)
