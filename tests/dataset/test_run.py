import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.dataset import work
from mitsuba_endo.dataset.asset_cache import AssetCache
from mitsuba_endo.dataset.contents import arrays_of
from mitsuba_endo.dataset.digests import file_digest
from mitsuba_endo.dataset.reader import Dataset
from mitsuba_endo.dataset.run import failures, locked, make_dataset
from mitsuba_endo.dataset.sample import make_sample
from mitsuba_endo.dataset.work import SampleOutcome, produce
from mitsuba_endo.errors import InputError
from mitsuba_endo.litter import aside_of
from tests.dataset.small import (
    SHEET,
    InThisProcess,
    contents_of,
    make_here,
    one_thread,
    small_config,
)

pytestmark = pytest.mark.usefixtures("llvm")
FORMATS = ("files", "hdf5")


class Interrupted(InThisProcess):
    """A pool in which Ctrl-C comes after three samples."""

    def run(self, indices):
        for number, result in enumerate(super().run(indices)):
            yield result
            if number == 2:
                raise KeyboardInterrupt


@pytest.fixture(scope="module", params=FORMATS)
def whole(request, tmp_path_factory):
    """A dataset of six samples made in one go, in both formats."""
    folder = tmp_path_factory.mktemp("whole") / request.param
    make_here(small_config(format=request.param), folder, 6)
    return request.param, folder


def test_what_is_stored_is_what_was_made(whole, tmp_path: Path):
    """Oracle: the sample's arrays before they are written."""
    form, folder = whole
    config, dataset = small_config(format=form), Dataset(folder)
    assert len(dataset) == 6
    with one_thread():
        sample = make_sample(config, 2, AssetCache(config, tmp_path))
    stored = dataset[2]
    for name, array in arrays_of(sample, radiance=True, surface=True).items():
        assert stored.arrays[name].dtype == array.dtype, name
        np.testing.assert_array_equal(stored.arrays[name], array, err_msg=name)
    assert sample.description.items() <= stored.description.items()
    assert sample.description["seed"] == 3
    assert {"tissue", "light", "effects", "seed"} <= sample.description["photograph"].keys()


def test_samples_differ_from_each_other(whole):
    """Oracle: inequality of images and poses."""
    stored = [Dataset(whole[1])[i] for i in range(6)]
    poses = {str(s.description["world_from_camera"]) for s in stored}
    assert len(poses) == 6
    assert len({s.arrays["image"].tobytes() for s in stored}) == 6


def test_the_manifest_lists_every_file_with_its_checksum(whole):
    """Oracle: SHA-256 of the files as they lie there."""
    form, folder = whole
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["failed"] == []
    if form == "hdf5":
        listed = {e["path"]: e["sha256"] for e in manifest["samples"]}
        assert [e["samples"] for e in manifest["samples"]] == [[0, 1, 2, 3], [4, 5]]
    else:
        listed = {
            f"{e['path']}/{n}": s for e in manifest["samples"] for n, s in e["sha256"].items()
        }
    there = {name for name in contents_of(folder) if not name.endswith(".mitsuba-endo")}
    assert set(listed) == there
    for name, digest in listed.items():
        assert digest == file_digest(folder / name)


def test_an_interrupted_run_goes_on_where_it_was(whole, tmp_path: Path):
    """Oracle: the bytes of the run that was not interrupted; half-written files put in by hand."""
    form, folder = whole
    config, out = small_config(format=form), tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        make_dataset(config, out, 6, Interrupted)
    assert len(Dataset(out)) == 3
    if form == "files":
        half = aside_of(out / "samples" / "000004", "partial")
        half.mkdir()
        (half / "image.png").write_bytes(b"half")
    else:
        aside_of(out / "staging" / "000004.h5", "partial").write_bytes(b"half")
    made = []

    def noted(job, index):
        made.append(index)
        return produce(job, index)

    make_dataset(config, out, 6, lambda job: InThisProcess(job, noted))
    assert made == [3, 4, 5]
    assert contents_of(out) == contents_of(folder)


def test_a_dataset_can_be_made_larger(whole, tmp_path: Path):
    """Oracle: the bytes of the larger one made at once; four samples fill a shard."""
    form, folder = whole
    config, out = small_config(format=form), tmp_path / "out"
    make_here(config, out, 5)
    make_here(config, out, 6)
    assert contents_of(out) == contents_of(folder)


def test_a_sealed_shard_whose_staged_samples_were_left_is_not_doubled(tmp_path: Path):
    """Oracle: the killed process's state, by hand: shard complete, staged files still there."""
    config, out = small_config(format="hdf5", shard=2), tmp_path / "out"
    make_here(config, out, 2)
    before = contents_of(out)
    (out / "staging").mkdir()
    (out / "staging" / "000001.h5").write_bytes((out / "shards" / "000000.h5").read_bytes())
    make_here(config, out, 2)
    assert contents_of(out) == before


def test_a_failed_sample_is_recorded_and_the_others_are_made(tmp_path: Path):
    """Oracle: a pool that makes sample 1 fail; later the same sample on demand."""
    config, out = small_config(format="hdf5", shard=3), tmp_path / "out"

    def failing(job, index):
        return SampleOutcome(index, "failed", "no luck.") if index == 1 else produce(job, index)

    done = make_dataset(config, out, 3, lambda job: InThisProcess(job, failing))
    assert (done.done, done.failed) == (2, 1)
    (record,) = failures(out)
    assert record == {"index": 1, "seed": 3, "status": "failed", "reason": "no luck."}
    assert Dataset(out).indices == [0, 2]
    assert json.loads((out / "manifest.json").read_text())["failed"] == [record]
    assert make_here(config, out, 3).failed == 1  # not tried again unasked
    again = make_here(config, out, 3, retry_failed=True)
    assert (again.done, again.failed) == (3, 0)
    assert Dataset(out).indices == [0, 1, 2]


def test_views_that_cannot_be_found_become_failures(tmp_path: Path):
    """Oracle: a sheet nearer than the margin, beside one that is not."""
    near = {**SHEET, "parameters": {"distance": 1.5, "edge": 6}}
    config = small_config(scenes=[SHEET, near], placing={"tries": 3})
    done = make_here(config, tmp_path / "out", 6)
    assert done.done + done.failed == 6
    assert 0 < done.failed < 6
    assert all(
        "no place for camera and projector" in r["reason"] for r in failures(tmp_path / "out")
    )


def test_a_full_disk_ends_the_run_with_one_sentence_and_it_goes_on_later(
    tmp_path: Path, monkeypatch
):
    """Oracle: the system's own error number, raised where a sample would appear."""
    config, out = small_config(), tmp_path / "out"
    real, room = os.replace, [2]

    def replaced(source, target):
        if Path(target).parent.name == "samples":
            room[0] -= 1
            if room[0] < 0:
                raise OSError(errno.ENOSPC, "No space left on device")
        return real(source, target)

    monkeypatch.setattr(os, "replace", replaced)
    with pytest.raises(InputError, match=r"no space left on device.*2 of 4 samples are kept"):
        make_here(config, out, 4)
    assert sorted(p.name for p in (out / "samples").iterdir()) == ["000000", "000001"]
    monkeypatch.setattr(os, "replace", real)
    assert make_here(config, out, 4).done == 4


def test_a_fault_of_the_program_in_one_sample_does_not_end_the_run(tmp_path: Path, monkeypatch):
    """Oracle: an exception that nobody expects, in sample 0 alone."""
    real = work.make_sample

    def faulty(config, index, assets):
        if index == 0:
            raise ZeroDivisionError("oh")
        return real(config, index, assets)

    monkeypatch.setattr(work, "make_sample", faulty)
    done = make_here(small_config(), tmp_path / "out", 2)
    assert (done.done, done.failed) == (1, 1)
    assert "ZeroDivisionError: oh" in failures(tmp_path / "out")[0]["reason"]


def test_another_configuration_is_refused(whole):
    """Oracle: the key that differs."""
    form, folder = whole
    before = contents_of(folder)
    with pytest.raises(InputError, match=r"another config\.camera\.width"):
        make_here(small_config(format=form, camera={"width": 41, "height": 30}), folder, 6)
    assert contents_of(folder) == before


def test_foreign_folders_and_running_ones_are_refused(tmp_path: Path):
    """Oracle: a file of somebody else's; a lock held by this very process."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(InputError, match="holds files that are no dataset"):
        make_here(small_config(), tmp_path / "mine", 1)
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is not a folder"):
        make_here(small_config(), tmp_path / "file", 1)
    (tmp_path / "busy").mkdir()
    with locked(tmp_path / "busy"), pytest.raises(InputError, match="another run is working"):
        make_here(small_config(), tmp_path / "busy", 1)


def test_progress_counts_and_foresees(tmp_path: Path):
    """Oracle: counting; the time left is the rest by the rate."""
    seen = []
    make_dataset(small_config(), tmp_path / "out", 3, InThisProcess, seen.append)
    assert [p.done for p in seen] == [0, 1, 2, 3]
    assert seen[0].seconds_left is None
    assert seen[1].seconds_left == pytest.approx(2 / seen[1].rate)
    assert replace(seen[1], done=2).seconds_left == pytest.approx(1 / seen[1].rate)


def test_nothing_of_the_cache_is_left(whole):
    """Oracle: the folder's listing."""
    names = {path.name for path in whole[1].iterdir()}
    rest = {"samples"} if whole[0] == "files" else {"shards"}
    assert names == {"dataset.json", "manifest.json", ".lock"} | rest


def test_a_samples_folder_is_a_capture_that_can_be_calibrated_and_judged(tmp_path: Path):
    """Oracle: the commands' own checks of their input; the truth compared with itself."""
    from mitsuba_endo.cli.calibrate import load_input
    from mitsuba_endo.evaluate.kinds.calibration import evaluate_calibration

    make_here(small_config(), tmp_path / "out", 1)
    folder = tmp_path / "out" / "samples" / "000000"
    (map_,), rig = load_input([folder / "map.exr"], folder / "rig.yaml")
    stored = Dataset(tmp_path / "out")[0].arrays
    np.testing.assert_array_equal(map_.valid, stored["visible"])
    assert rig.projector.focal.value is None
    metrics = evaluate_calibration(folder, [folder / "truth.json"])
    assert metrics.focal_error_percent == 0
    assert metrics.rotation_error_deg == pytest.approx(0, abs=1e-6)
    assert metrics.shape_rmse_mm == pytest.approx(0, abs=1e-4)
