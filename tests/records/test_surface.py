"""The surface file: round trip, other programs' view of it, bad files."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.surface import load_surface, save_surface

VERTICES = np.array([[0, 0, 70.25], [10, 0, 71], [0, 12, 69], [11, 12.5, 72], [5, 6, 80]])
FACES = np.array([[0, 2, 1], [1, 2, 3]])
STD = np.array([0.125, 0.25, 0.5, 1.0, 2.0])


def _save(path: Path, std: np.ndarray | None = STD) -> Path:
    save_surface(path, SurfaceEstimate(VERTICES, FACES, std))
    return path


@pytest.mark.parametrize("std", [STD, None])
def test_round_trip(tmp_path: Path, std: np.ndarray | None):
    """Oracle: the arrays, all exact in float32; the unused vertex keeps its place."""
    loaded = load_surface(_save(tmp_path / "s.ply", std))
    np.testing.assert_array_equal(loaded.vertices, VERTICES)
    np.testing.assert_array_equal(loaded.faces, FACES)
    if std is None:
        assert loaded.std is None
    else:
        np.testing.assert_array_equal(loaded.std, std)


def test_trimesh_reads_it(tmp_path: Path):
    """Oracle: trimesh's own reader."""
    mesh = trimesh.load_mesh(_save(tmp_path / "s.ply"), process=False)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    np.testing.assert_array_equal(mesh.faces, FACES)


def test_mitsuba_reads_it_with_the_standard_deviations(tmp_path: Path, llvm: str):
    """Oracle: Mitsuba's own ply plugin."""
    import mitsuba as mi

    mesh = mi.load_dict({"type": "ply", "filename": str(_save(tmp_path / "s.ply"))})
    parameters = mi.traverse(mesh)
    np.testing.assert_array_equal(
        np.array(parameters["vertex_positions"]), VERTICES.ravel().astype(np.float32)
    )
    np.testing.assert_array_equal(np.array(parameters["vertex_std"]), STD.astype(np.float32))


def test_bad_files(tmp_path: Path):
    """Oracle: one sentence with the file's name for each fault."""
    with pytest.raises(InputError, match="no such file"):
        load_surface(tmp_path / "none.ply")
    (tmp_path / "bad.ply").write_text("hello")
    with pytest.raises(InputError, match=r"bad.ply: is not a readable mesh"):
        load_surface(tmp_path / "bad.ply")
    broken = np.where(VERTICES == 72, np.nan, VERTICES)
    save_surface(tmp_path / "nan.ply", SurfaceEstimate(broken, FACES))
    with pytest.raises(InputError, match="no triangles with finite vertices"):
        load_surface(tmp_path / "nan.ply")
    trimesh.PointCloud(VERTICES).export(tmp_path / "points.ply")
    with pytest.raises(InputError, match="no triangles with finite vertices"):
        load_surface(tmp_path / "points.ply")
