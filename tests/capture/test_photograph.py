"""Photographs against closed forms and against each other."""

import numpy as np
import pytest

from mitsuba_endo.capture.photograph import Photograph, photograph
from mitsuba_endo.capture.settings import CaptureSettings, Light, Tissue
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.shapes import make_shape
from scripts.benchmarks.plane_under_grid import PlaneUnderGrid, plane_under_grid

SMALL = CameraModel("opencv", 48, 36, np.array([[40.0, 0, 22.8], [0, 40, 18.4], [0, 0, 1]]))


def _shoot(setup: PlaneUnderGrid, settings: CaptureSettings, seed: int = 0) -> Photograph:
    return photograph(
        setup.mesh, setup.camera, RigidTransform.identity(), setup.projector, setup.pose,
        setup.grid.image(), settings, seed, pattern_size=(setup.grid.width, setup.grid.height),
    )  # fmt: skip


def _colon(settings: CaptureSettings, seed: int = 0, **changes: object) -> Photograph:
    setup = plane_under_grid()
    mesh = make_shape("colon", seed=3, edge=2.5)
    given = {"mesh": mesh, "world_from_camera": RigidTransform.identity(), **changes}
    return photograph(
        given["mesh"], SMALL, given["world_from_camera"], setup.projector, setup.pose,  # pyright: ignore
        setup.grid.image(), settings, seed, pattern_size=(setup.grid.width, setup.grid.height),
    )  # fmt: skip


def test_a_matt_plane_under_the_grid_is_the_closed_form(llvm: str) -> None:
    """Oracle: intensity, inverse square law, cosine and Burley's reflectance in NumPy.

    1 % of full scale in the median, and 2 % on the mean light: pixels are averaged over 16 places
    there and 64 random ones here.
    """
    setup = plane_under_grid()
    taken = _shoot(setup, setup.settings(64)).radiance
    expected = setup.radiance()
    full = np.percentile(expected[..., 1], 99.5)
    assert (expected[..., 1] > 0.5 * full).mean() > 0.1
    assert np.median(np.abs(taken - expected)[..., 1]) < 0.01 * full
    np.testing.assert_allclose(taken.mean((0, 1)), expected.mean((0, 1)), rtol=0.02)


def test_the_seed_decides_everything_random(llvm: str) -> None:
    """Oracle: equality for one seed, difference for another; radiance up to summation order."""
    settings = CaptureSettings(spp=2, light=Light(lamp=0.3))
    first, again, other = (_colon(settings, seed) for seed in (1, 1, 2))
    np.testing.assert_allclose(first.radiance, again.radiance, rtol=1e-5, atol=1e-7)
    assert np.abs(first.image.astype(int) - again.image).max() <= 1
    assert (first.image != other.image).mean() > 0.5


def test_the_lamp_adds_its_light_and_leaves_the_laser_alone(llvm: str) -> None:
    """Oracle: superposition; the lamp's light is proportional to its setting.

    Pixels are compared in the median. A scene with a lamp is another kernel, which a processor may
    round otherwise, and 1e-7 mm are enough to send one path in forty to another place.
    """
    tissue = Tissue(subsurface="none")
    dark, dim, bright = (
        _colon(CaptureSettings(spp=4, tissue=tissue, light=Light(lamp=lamp)))
        for lamp in (0.0, 0.2, 0.4)
    )
    np.testing.assert_array_equal(dark.radiance, dark.laser)
    change = np.abs(dim.laser - dark.laser)[dark.laser > 0] / dark.laser[dark.laser > 0]
    assert np.median(change) < 1e-5
    np.testing.assert_allclose(dim.laser.mean((0, 1)), dark.laser.mean((0, 1)), rtol=1e-3)
    lamp = (dim.radiance - dim.laser).astype(float)
    assert lamp[..., 0].mean() > lamp[..., 2].mean() > 0  # reddish tissue
    np.testing.assert_allclose((bright.radiance - bright.laser).mean(), 2 * lamp.mean(), rtol=1e-3)


def test_a_lumen_gets_light_by_interreflection(llvm: str) -> None:
    """Oracle: every reflection more adds light, also where the laser does not shine directly."""
    tissue = Tissue(subsurface="none")
    direct, once, more = (
        _colon(CaptureSettings(spp=8, max_depth=depth, tissue=tissue)).radiance[..., 1]
        for depth in (2, 3, 5)
    )
    assert direct.mean() < once.mean() < more.mean()
    shadow = direct < 1e-6
    assert shadow.mean() > 0.02
    assert once[shadow].mean() > 0.001 * direct.mean()


def test_parts_add_up_to_the_whole_tissue(llvm: str) -> None:
    """Oracle: light that enters, hardly spread, and light that is reflected are the full material.

    A mean free path far below a pixel leaves no blur; direct light only.
    """

    def taken(subsurface: str) -> np.ndarray:
        tissue = Tissue(subsurface=subsurface, mean_free_path=1e-4, relief=0)  # pyright: ignore
        return _colon(CaptureSettings(spp=4, max_depth=2, tissue=tissue)).radiance

    np.testing.assert_allclose(taken("blur"), taken("none"), rtol=0.02, atol=1e-4)


def test_a_medium_sends_back_light_from_beside_the_lines(llvm: str) -> None:
    """Oracle: light between the lines, where opaque tissue under a grid is dark."""
    setup = plane_under_grid()
    between = setup.radiance()[..., 1]
    dark = between < np.percentile(between, 30)

    def taken(subsurface: str) -> float:
        tissue = setup.tissue.model_copy(
            update={"subsurface": subsurface, "mean_free_path": 1.0, "roughness": 0.6}
        )
        settings = setup.settings(16).model_copy(update={"tissue": tissue})
        image = _shoot(setup, settings).radiance[..., 1]
        return float(np.mean(image[dark]) / np.mean(image))

    opaque, blur, medium = (taken(s) for s in ("none", "blur", "medium"))
    assert blur > 2 * opaque
    assert medium > 2 * opaque


def test_mistakes_are_told(llvm: str) -> None:
    """Oracle: the error's words."""
    settings = CaptureSettings(spp=1)
    mesh = make_shape("colon", seed=3, edge=2.5)
    metres = type(mesh)(mesh.vertices / 1000, mesh.faces)
    with pytest.raises(ValueError, match=r"metres.*multiply it by 1000"):
        _colon(settings, mesh=metres)
    turned = type(mesh)(mesh.vertices, mesh.faces[:, ::-1].copy())
    with pytest.raises(ValueError, match=r"backs of faces.*turn the mesh's faces"):
        _colon(settings, mesh=turned)
    with pytest.raises(ValueError, match="sees nothing"):
        _colon(settings, world_from_camera=RigidTransform.of([0, 0, 0], [500.0, 0, 900]))
    in_the_wall = RigidTransform.of([0, np.pi / 2, 0], [26.0, 3, 40])
    with pytest.raises(ValueError, match=r"backs of faces|sees nothing"):
        _colon(settings, world_from_camera=in_the_wall)
