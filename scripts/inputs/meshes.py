"""Surfaces for datasets."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from mitsuba_endo.dataset.scene_ranges import Scene
from mitsuba_endo.dataset.user_mesh import load_user_mesh

from .case import REFUSED, RIGHT, Case, Ending

BALL = trimesh.creation.icosphere(2, 40.0)
CLOSE = 1e-4
"""Millimetres: single precision of files."""


def case(brings: str, name: str, write: Callable[[Path], object], refused: str = "") -> Case:
    """Return a case of a ball of 40 mm radius."""

    def run(folder: Path) -> Ending:
        write(folder / name)
        # Seen from its faces' side, no renderer is needed.
        scene = Scene.model_validate({"kind": "file", "file": str(folder / name), "side": "front"})
        found = load_user_mesh(scene)
        same = len(found.vertices) == len(BALL.vertices)
        apart = np.abs(np.sort(found.vertices, 0) - np.sort(BALL.vertices, 0)).max() if same else 9
        return Ending(float(apart) / CLOSE)

    return Case("mesh", brings, REFUSED if refused else RIGHT, refused, run)


def exported(vertices: np.ndarray) -> Callable[[Path], object]:
    mesh = trimesh.Trimesh(vertices, BALL.faces, process=False)
    return lambda path: mesh.export(path)


def _far(path: Path) -> None:
    lines = [f"v {x + 8e8:.6f} {y - 5e8:.6f} {z:.6f}" for x, y, z in BALL.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in BALL.faces]
    path.write_text("\n".join(lines), "utf-8")


def _nowhere() -> np.ndarray:
    vertices = np.array(BALL.vertices)
    vertices[5] = np.nan
    return vertices


CASES = [
    case("STL", "a.stl", exported(BALL.vertices)),
    case("PLY with a vertex nowhere that no triangle has", "a.ply",
         exported(np.vstack([BALL.vertices, [[np.nan] * 3]]))),
    case("PLY with a triangle nowhere", "a.ply", exported(_nowhere()), "finite vertices"),
    case("OBJ 900 km from the origin", "a.obj", _far),
    case("PLY in metres", "a.ply", exported(BALL.vertices / 1000), "try unit: m"),
    case("a point cloud", "a.ply", lambda path: trimesh.PointCloud(BALL.vertices).export(path),
         "holds no triangles"),
]  # fmt: skip
