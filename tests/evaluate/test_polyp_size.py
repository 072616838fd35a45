import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.polyp_size import PolypSize, measure_polyp
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.calibration import SurfaceEstimate

CAMERA = CameraModel("opencv", 160, 120, np.array([[110.0, 0, 83], [0, 108, 57], [0, 0, 1]]))
RADIUS, DISTANCE, AT = 5.0, 30.0, np.array([3.0, -2.0])
"""Of the ball; of the plane z = DISTANCE; of the ball's axis, mm."""


def capped_plane(sunk: float = 0.0) -> SurfaceEstimate:
    """The plane with the cap of a ball whose centre is ``sunk`` behind it, on a grid of pixels."""
    x, y = np.meshgrid(np.arange(0, 160, 1.5), np.arange(0, 120, 1.5))
    rays = CAMERA.rays(np.stack([x, y], -1))
    centre = np.array([*AT, DISTANCE + sunk])
    along = rays @ centre
    inside = RADIUS**2 - (centre @ centre - along**2)
    ball = along - np.sqrt(np.where(inside > 0, inside, np.nan))
    wall = DISTANCE / rays[..., 2]
    vertices = (rays * np.fmin(ball, wall)[..., None]).reshape(-1, 3)
    rows, columns = x.shape
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (p.ravel() for p in (at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]))
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)])
    return SurfaceEstimate(vertices, faces, np.full(len(vertices), 0.05))


def measured(surface: SurfaceEstimate, factor: float = 1.15, **more: float) -> PolypSize:
    """Measure in a circle around the polyp that is not quite right."""
    middle = CAMERA.project(np.array([[*AT, DISTANCE]]))[0] + np.array([1.2, -0.8])
    return measure_polyp(surface, CAMERA, middle, factor * 110 * RADIUS / DISTANCE, **more)


@pytest.mark.parametrize("factor", [1.05, 1.3])
@pytest.mark.parametrize("sunk", [0.0, 1.5])
def test_a_cap_on_a_plane_has_the_diameter_of_its_base(sunk: float, factor: float) -> None:
    """Oracle: the circle of a ball cut by a plane, 2 sqrt(R^2 - h^2), and its height R - h.

    The grid samples the rim to 0.4 mm, so an eighth of that is allowed on the diameter.
    """
    size = measured(capped_plane(sunk), factor)
    assert size.diameter == pytest.approx(2 * np.sqrt(RADIUS**2 - sunk**2), abs=0.05)
    assert size.height == pytest.approx(RADIUS - sunk, abs=0.05)


def test_noise_is_covered_by_the_interval() -> None:
    """Oracle: simulation. Each draw errs by its noise; 95 % intervals cover 20 draws but few."""
    exact = capped_plane(1.0)
    true = 2 * np.sqrt(RADIUS**2 - 1.0)
    rays = exact.vertices / np.linalg.norm(exact.vertices, axis=1, keepdims=True)
    found = []
    for seed in range(20):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(len(rays))
        std = np.full(len(rays), 0.1)
        noisy = SurfaceEstimate(exact.vertices + noise[:, None] * rays, exact.faces, std)
        found.append(measured(noisy))
    covered = [f.interval[0] <= true <= f.interval[1] for f in found]
    assert np.mean(covered) >= 0.85
    scatter = np.std([f.diameter for f in found])
    assert 0.4 * scatter < np.median([f.std for f in found]) < 3 * scatter


def test_a_common_error_of_range_scales_the_size() -> None:
    """Oracle: a mode in which all ranges grow by 2 % is a size 2 % larger."""
    surface = capped_plane(1.0)
    ranges = np.linalg.norm(surface.vertices, axis=1)
    common = SurfaceEstimate(surface.vertices, surface.faces, 0.03 * ranges, 0.02 * ranges[:, None])
    size = measured(common)
    assert size.std_calibration == pytest.approx(0.02 * size.diameter, rel=0.05)


def test_the_units_uncertainty_counts() -> None:
    """Oracle: 1.5 % of the diameter, added in quadrature to the rest."""
    without, size = measured(capped_plane()), measured(capped_plane(), scale_std_percent=1.5)
    assert size.std_unit == pytest.approx(0.015 * size.diameter)
    assert size.std == pytest.approx(np.hypot(without.std, size.std_unit))


def test_a_bare_wall_is_no_polyp() -> None:
    """Oracle: the surface is a plane with noise."""
    with pytest.raises(InputError, match="stands out"):
        measured(capped_plane(sunk=RADIUS + 1.0))


def test_a_circle_beside_the_surface_is_refused() -> None:
    """Oracle: there is nothing at the image's far corner."""
    with pytest.raises(InputError, match="vertices"):
        measure_polyp(capped_plane(), CAMERA, (400.0, 400.0), 10.0)
