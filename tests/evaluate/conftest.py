"""Surfaces and cameras in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate

CAMERA = CameraModel("opencv", 67, 45, np.array([[60.0, 0, 30], [0, 64, 24], [0, 0, 1]]))
PROJECTOR = projector_model("direction_cosine", 120.0, (50.0, 38.0), 1.02, [0.03])
SIZE = (110, 84)
PROJECTOR_FROM_CAMERA = RigidTransform.of([0.05, -0.12, 0.03], [-6.0, 1.2, 0.4])


def sheet(
    depth: float = 70.0,
    slope: tuple[float, float] = (0.0, 0.0),
    low: tuple[float, float] = (-60.0, -45.0),
    high: tuple[float, float] = (55.0, 50.0),
    steps: int = 7,
) -> SurfaceEstimate:
    """The plane z = depth + slope . (x, y) over a rectangle in x and y."""
    x, y = np.meshgrid(np.linspace(low[0], high[0], steps), np.linspace(low[1], high[1], steps))
    vertices = np.stack([x, y, depth + slope[0] * x + slope[1] * y], -1).reshape(-1, 3)
    row, column = np.divmod(np.arange((steps - 1) ** 2), steps - 1)
    a = row * steps + column
    faces = np.concatenate(
        [np.stack([a, a + steps, a + 1], -1), np.stack([a + 1, a + steps, a + steps + 1], -1)]
    )
    return SurfaceEstimate(vertices, faces)


@pytest.fixture
def world() -> SimpleNamespace:
    """The constants and the maker of sheets above (test files cannot import one another)."""
    return SimpleNamespace(
        camera=CAMERA, projector=PROJECTOR, size=SIZE, pose=PROJECTOR_FROM_CAMERA, sheet=sheet
    )
