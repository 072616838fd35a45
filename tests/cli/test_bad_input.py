"""Input that the user can mend ends with one sentence and exit code 2, and leaves nothing behind.

Oracle of every test: the contract of the commands, and the file and field that the test spoilt.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.inputs import HEIGHT, WIDTH, Result, q, rig, run, write


def _calibrate(folder: Path, *more: object) -> Result:
    return run(
        "calibrate",
        folder / "map.npz",
        "--rig",
        folder / "rig.yaml",
        "--out",
        folder / "out",
        *more,
    )


def _check(result: Result, *expected: str) -> None:
    """One sentence on stderr that holds the expected parts, and nothing on stdout."""
    assert result.exit_code == 2, result.stderr
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("error: ")
    assert lines[0].endswith(".")
    for part in expected:
        assert part in lines[0]


def _listing(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def _spoilt_map(change: Callable[[np.ndarray], object]) -> np.ndarray:
    values = q()
    changed = change(values)
    return changed if isinstance(changed, np.ndarray) else values


MAPS = {
    "nothing finite": (lambda m: m.fill(np.nan), "no finite value"),
    "normalised units": (lambda m: m / 300, "between 0 and 1"),
    "units of another pattern": (lambda m: m * 40, "projector.width"),
    "fewer than 50": (lambda m: m[3:].fill(np.nan) or m[:3, 16:].fill(np.nan), "48 usable"),
    "one channel": (lambda m: m[..., 0], "HxWx2"),
    "three channels": (lambda m: np.concatenate([m, m[..., :1]], -1), "HxWx2"),
    "transposed": (lambda m: np.swapaxes(m, 0, 1), f"{HEIGHT} x {WIDTH}"),
    "text": (lambda m: m.astype(str), "HxWx2"),
    "mirrored": (lambda m: m * [-1, 1] + [239, 0], "it is mirrored"),
    "upside down": (lambda m: m * [1, -1] + [0, 119], "projector.y runs upwards"),
    "x and y swapped": (lambda m: m[..., ::-1] * [1, 0.5], "swapped"),
}


@pytest.mark.parametrize("case", MAPS)
def test_map(tmp_path: Path, case: str):
    change, expected = MAPS[case]
    write(tmp_path, map_data=_spoilt_map(change))
    before = _listing(tmp_path)
    _check(_calibrate(tmp_path), "map.npz", expected)
    assert _listing(tmp_path) == before


def _set(*path_and_value: Any) -> dict[str, Any]:
    data = rig()
    *path, key, value = path_and_value
    node = data
    for part in path:
        node = node[part]
    node[key] = value
    return data


def _matrix(fx: float) -> list[list[float]]:
    return [[fx, 0, 11.0], [0, 31.0, 7.0], [0, 0, 1]]


RIGS = {
    "NaN in camera matrix": (_set("camera", "K", _matrix(float("nan"))), "camera.K"),
    "zero focal in camera matrix": (_set("camera", "K", _matrix(0.0)), "camera.K"),
    "negative focal in camera matrix": (_set("camera", "K", _matrix(-30.0)), "camera.K"),
    "2 x 3 camera matrix": (_set("camera", "K", _matrix(30.0)[:2]), "camera.K"),
    "unknown law": (_set("projector", "law", "pinole"), "projector.law", "direction_cosine"),
    "unknown camera model": (_set("camera", "model", "kannala"), "camera.model", "opencv_fisheye"),
    "misspelt key": (_set("projector", "focla", 300.0), "projector.focla", "did you mean 'focal'"),
    "misspelt block": (_set("cammera", {}), "cammera", "did you mean 'camera'"),
    "wrong units": (_set("units", "cm"), "units", "mm"),
    "camera of another size": (_set("camera", "width", WIDTH + 1), "camera.width", "map.npz"),
    "negative baseline": (_set("scale", {"baseline": -6.0}), "scale.baseline"),
    "not a rotation": (
        _set("projector", "pose", {"R": np.ones((3, 3)).tolist(), "t": [1, 0, 0]}),
        "projector.pose.R",
    ),
    "fixed focal without value": (_set("projector", "focal", {"refine": False}), "projector.focal"),
    "negative deviation of the baseline": (
        _set("scale", {"baseline": 6.0, "baseline_std": -0.1}), "scale.baseline_std",
    ),
    "drift without spread": (_set("drift", {"insertion_mm": 0.0}), "drift.insertion_mm"),
    "negative drift": (_set("drift", {"roll_deg": -1.0}), "drift.roll_deg"),
    "camera matrix known exactly, and refined": (
        _set("camera", "K_std", [1.0, 0.0, 1.0, 1.0]), "camera.K_std",
    ),
    "negative deviation of a coefficient": (
        _set("camera", "distortion_std", [0.01, -0.01]), "camera.distortion_std",
    ),
    "fewer deviations than coefficients": (
        _set("camera", "distortion_std", [0.01]), "camera", "k1, k2", "one number for all",
    ),
    "projector's centre known exactly, and refined": (
        _set("projector", "centre_std", [0.0, 1.0]), "projector.centre_std",
    ),
    "missing camera": ({k: v for k, v in rig().items() if k != "camera"}, "camera", "missing"),
}  # fmt: skip


@pytest.mark.parametrize("case", RIGS)
def test_rig(tmp_path: Path, case: str):
    data, *expected = RIGS[case]
    write(tmp_path, rig_data=data)
    before = _listing(tmp_path)
    _check(_calibrate(tmp_path), *expected)
    assert _listing(tmp_path) == before


def test_rig_that_is_not_yaml(tmp_path: Path):
    write(tmp_path)
    (tmp_path / "rig.yaml").write_text("camera: [1, 2", encoding="utf-8")
    _check(_calibrate(tmp_path), "rig.yaml", "YAML")


@pytest.mark.parametrize("name", ["rig.yaml", "map.npz"])
def test_missing_file(tmp_path: Path, name: str):
    write(tmp_path)
    (tmp_path / name).unlink()
    before = _listing(tmp_path)
    _check(_calibrate(tmp_path), name, "no such file")
    assert _listing(tmp_path) == before


def test_damaged_map(tmp_path: Path):
    write(tmp_path)
    data = (tmp_path / "map.npz").read_bytes()
    (tmp_path / "map.npz").write_bytes(data[: len(data) // 2])
    _check(_calibrate(tmp_path), "map.npz")


@pytest.mark.parametrize(
    ("share", "expected"),
    [
        ("surface", "'surface' is not block=mode"),
        ("surfase=shared", "did you mean 'surface'"),
        ("surface=sometimes", "surface"),
        ("focal=fixed,", "'' is not block=mode"),
        ("focal=fixed,focal=shared", "focal is to be fixed and shared"),
    ],
)
def test_share(tmp_path: Path, share: str, expected: str):
    write(tmp_path)
    _check(_calibrate(tmp_path, "--share", share), "--share", expected)


@pytest.mark.parametrize(
    ("share", "expected"),
    [
        ("surface=fixed", "share.surface"),
        ("focal=fixed", "projector.focal.value"),
        ("projector_pose=fixed", "projector.pose"),
        ("camera_pose=shared", "share.camera_pose"),
        ("camera_pose=fixed", "share.camera_pose"),
        ("camera_focal=per_frame", "share.camera_focal"),
        ("projector_pose=shared", "drift"),
        ("drift=shared", "--share"),
    ],
)
def test_contradictory_plan(tmp_path: Path, share: str, expected: str):
    """Two frames, and a drift of the projector from one to the next."""
    write(tmp_path, rig_data=_set("drift", {"roll_deg": 1.0}))
    np.savez(tmp_path / "second.npz", map=q() + np.float32(0.5))
    before = _listing(tmp_path)
    _check(_calibrate(tmp_path, tmp_path / "second.npz", "--share", share), expected)
    assert _listing(tmp_path) == before


@pytest.mark.parametrize("own", [False, True])
def test_mesh_of_nothing_in_common(tmp_path: Path, own: bool):
    """One frame, and two that share no surface: no lattice is solved in the mesh's stead."""
    write(tmp_path)
    np.savez(tmp_path / "second.npz", map=q() + np.float32(0.5))
    more = [tmp_path / "second.npz", "--share", "surface=per_frame"] if own else []
    expected = "share.surface: shared" if own else "give more maps"
    _check(_calibrate(tmp_path, "--surface", "mesh", *more), "surface", "mesh", expected)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("out", ["taken/out", "taken"])
def test_output_cannot_be_written(tmp_path: Path, out: str):
    """A file in the way stands for a folder without permission, which root may write anyway."""
    write(tmp_path)
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    result = run("calibrate", tmp_path / "map.npz", "--rig", tmp_path / "rig.yaml",
                 "--out", tmp_path / out)  # fmt: skip
    _check(result, str(tmp_path / out), "folder")
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"


def test_foreign_output_folder_is_refused_and_kept(tmp_path: Path):
    write(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("mine", encoding="utf-8")
    _check(_calibrate(tmp_path), "out", "did not write")
    assert (tmp_path / "out" / "thesis.tex").read_text(encoding="utf-8") == "mine"


def test_output_is_checked_before_the_input_is_read(tmp_path: Path):
    """With both wrong, the output is named: nobody waits for a result that has no place."""
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    _check(_calibrate(tmp_path), "out", "not a folder")


def test_errors_with_json(tmp_path: Path):
    """Oracle: stdout is one JSON object with the sentence of stderr."""
    import json

    write(tmp_path, rig_data=_set("projector", "law", "pinole"))
    result = _calibrate(tmp_path, "--json")
    data = json.loads(result.stdout)
    assert data["exit_code"] == result.exit_code == 2
    assert result.stderr == f"error: {data['error']}\n"


def test_unknown_option_value():
    result = run("calibrate", "m.npz", "--rig", "r.yaml", "--out", "o", "--solver", "newton")
    assert result.exit_code == 2
    assert "gauss-newton" in result.stderr


def test_evaluate_missing_truth(tmp_path: Path):
    (tmp_path / "solution.json").write_text("{}", encoding="utf-8")
    result = run("evaluate", tmp_path / "solution.json", "--truth", tmp_path / "t.json",
                 "--out", tmp_path / "m.json")  # fmt: skip
    _check(result, "solution.json", "is missing")
    assert _listing(tmp_path) == ["solution.json"]
