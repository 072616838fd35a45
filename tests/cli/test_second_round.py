"""``calibrate`` on an image: its second round, switched off, and resumed."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import yaml

from mitsuba_endo.cli.second_round import keep_earlier_maps
from mitsuba_endo.records.correspondence import CorrespondenceMap, load_map, write_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.rounds import second_round
from tests.cli.inputs import run
from tests.decoding.grid_views import CAMERA, SIZE, photo, view


def _inputs(folder: Path) -> tuple[Path, Path]:
    """Write a photograph and its rig."""
    rig, image = folder / "rig.yaml", folder / "frame.png"
    data = {
        "camera": Camera.from_model(CAMERA).model_dump(),
        "projector": {"law": "direction_cosine", "width": SIZE[0], "height": SIZE[1]},
    }
    rig.write_text(yaml.safe_dump(data), encoding="utf-8")
    assert cv2.imwrite(str(image), photo(view("sheet")))
    return rig, image


def test_second_round_is_told_and_its_maps_are_kept(llvm, tmp_path: Path, monkeypatch):
    """Oracle: the files. With any change worth a solve, the decoded map is the one calibrated, and
    its state is gone on from by the image alone; switched off, nothing is said."""
    monkeypatch.setattr(second_round, "WORTH", -1.0)
    rig, image = _inputs(tmp_path)
    out, plain, more = (tmp_path / name for name in ("out", "plain", "more"))
    first = run("calibrate", image, "--rig", rig, "--out", out)
    assert first.exit_code == 0, first.stdout
    assert "Second round, along the epipolar lines:" in first.stdout
    observed, decoded = load_map(out / "observed.exr"), load_map(out / "decoded" / "frame.exr")
    np.testing.assert_array_equal(observed.q, decoded.q)
    channels = read_exr(out / "decoded" / "frame.exr")
    assert ((channels["confidence"] > 0) == decoded.valid).all()
    off = run("calibrate", image, "--rig", rig, "--out", plain, "--no-second-round")
    assert off.exit_code == 0, off.stdout
    assert "Second round" not in off.stdout
    assert not np.array_equal(load_map(plain / "decoded" / "frame.exr").q, decoded.q, True)
    again = run("calibrate", image, "--rig", rig, "--out", more, "--resume", out)
    assert again.exit_code == 0, again.stdout
    assert "Second round" not in again.stdout
    np.testing.assert_array_equal(load_map(more / "decoded" / "frame.exr").q, decoded.q)


def test_only_maps_of_the_same_image_are_taken_over(tmp_path: Path):
    """Oracle: the files' bytes."""
    q = np.mgrid[:20, :30].transpose(1, 2, 0)[..., ::-1].astype(np.float32)
    holed = q.copy()
    holed[5:9, 5:9] = np.nan
    for case, earlier, taken in (("same", q, True), ("other", q + 40, False),
                                 ("small", q[:10], False)):  # fmt: skip
        fresh, old = tmp_path / case / "fresh", tmp_path / case / "old" / "decoded"
        fresh.mkdir(parents=True)
        old.mkdir(parents=True)
        write_map(fresh / "a.exr", CorrespondenceMap(holed, "a"))
        write_map(old / "a.exr", CorrespondenceMap(earlier, "a"))
        before = (fresh / "a.exr").read_bytes()
        shutil.copyfile(fresh / "a.exr", fresh / "b.exr")
        keep_earlier_maps(fresh, tmp_path / case / "old")
        expected = (old / "a.exr").read_bytes() if taken else before
        assert (fresh / "a.exr").read_bytes() == expected
        assert (fresh / "b.exr").read_bytes() == before
