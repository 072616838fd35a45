"""The solid textures of tissue, inside Mitsuba, against the same formulas in NumPy."""

from typing import Any

import numpy as np
import pytest

from mitsuba_endo.capture.relief import relief
from mitsuba_endo.capture.solid_fields import field_from_tissue, network_distance, waves
from mitsuba_endo.capture.vessels import ABSORPTION, vessel_density


def _points(count: int = 3000, size: float = 40.0) -> np.ndarray:
    return np.random.default_rng(3).uniform(-size, size, (3, count))


def _interaction(points: np.ndarray) -> Any:
    import drjit as dr
    import mitsuba as mi

    si = dr.zeros(mi.SurfaceInteraction3f, points.shape[1])  # pyright: ignore
    si.p = mi.Point3f(points)  # pyright: ignore
    return si


def _placed(points: np.ndarray, seed: int) -> np.ndarray:
    field = field_from_tissue(seed)
    return field.R @ points + field.t[:, None]


def test_vessels_in_mitsuba_are_those_in_numpy(llvm: str) -> None:
    """Oracle: the field in double precision.

    Positions of a kilometre in single precision are good to 0.06 um, which the thinnest vessels
    (0.1 mm) turn into less than 1 %.
    """
    import mitsuba as mi

    base = [0.7, 0.4, 0.3]
    texture: Any = mi.load_dict({
        "type": "vessels", "contrast": 0.6, "scale": 5.0, "seed": 4,
        "base": {"type": "rgb", "value": base},
    })  # fmt: skip
    points = _points()
    got = np.array(texture.eval(_interaction(points)))
    taken = 0.6 * vessel_density(tuple(_placed(points, 4)), 5.0)
    expected = np.stack([b * (1 - a * taken) for b, a in zip(base, ABSORPTION, strict=True)])
    np.testing.assert_allclose(got, expected, atol=0.01)
    assert 0.02 < (taken > 0.3).mean() < 0.3  # some vessels, mostly none
    assert taken.max() <= 0.6 + 1e-12


def test_relief_has_the_slope_that_is_asked_for(llvm: str) -> None:
    """Oracle: finite differences of the height along u and v, and the slope's mean square."""
    import mitsuba as mi

    texture: Any = mi.load_dict({"type": "tissue_relief", "slope": 0.2, "seed": 1})
    points, u, v = _points(), np.array([1.0, 0.2, 0.3]), np.array([-0.3, 1.1, 0.1])
    si = _interaction(points)
    si.dp_du, si.dp_dv = mi.Vector3f(u.tolist()), mi.Vector3f(v.tolist())  # pyright: ignore
    got = np.array(texture.eval_1_grad(si))
    step = 1e-4
    for i, along in enumerate((u, v)):
        ends = [0.2 * relief(tuple(_placed(points + s * step * along[:, None], 1)))[0]
                for s in (-1, 1)]  # fmt: skip
        np.testing.assert_allclose(got[i], (ends[1] - ends[0]) / (2 * step), atol=2e-3)
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    gradient = 0.2 * np.stack(relief(tuple(_placed(points, 1)))[1])
    rotated = field_from_tissue(1).R @ normal
    along_surface = gradient - rotated[:, None] * (rotated @ gradient)
    assert np.sqrt((along_surface**2).sum(0).mean()) == pytest.approx(0.2, rel=0.15)


def test_waves_have_unit_variance_and_an_exact_gradient() -> None:
    """Oracle: sample variance over many wavelengths, and finite differences."""
    points = _points(20000, 200.0)
    value, gradient = waves(tuple(points), 5.0, 7)
    assert value.var() == pytest.approx(1, rel=0.1)
    step = 1e-5
    for axis in range(3):
        shifted = points.copy()
        shifted[axis] += step
        difference = (waves(tuple(shifted), 5.0, 7)[0] - value) / step
        np.testing.assert_allclose(gradient[axis], difference, atol=1e-3)


def test_distance_to_the_network_grows_with_slope_one() -> None:
    """Oracle: close to a wall the gradient of a distance has length 1 (finite differences)."""
    points = _points(20000, 100.0)
    distance = network_distance(tuple(points), 20.0, 0)
    assert (distance >= 0).all()
    near = (distance > 0.05) & (distance < 0.15)
    assert near.sum() > 50
    step, squared = 1e-4, 0.0
    for axis in range(3):
        shifted = points[:, near].copy()
        shifted[axis] += step
        squared += ((network_distance(tuple(shifted), 20.0, 0) - distance[near]) / step) ** 2
    assert np.median(np.sqrt(squared)) == pytest.approx(1, abs=0.1)


def test_tissue_renders_in_every_variant(any_variant: str) -> None:
    """Oracle: vessels take away light, as much as their mean density says; relief changes little.

    1 % of the mean is more than four standard errors of 12 x 8 pixels with 16 samples.
    """
    import mitsuba as mi

    def mean_light(contrast: float) -> float:
        vessels = {"type": "vessels", "contrast": contrast, "scale": 2.0}
        wall = mi.ScalarTransform4f().translate([0, 0, 10]).rotate([0, 1, 0], 180).scale(20)  # pyright: ignore
        scene = mi.load_dict({
            "type": "scene", "integrator": {"type": "direct"}, "lamp": {"type": "constant"},
            "camera": {"type": "perspective", "fov": 50, "film": {
                "type": "hdrfilm", "width": 12, "height": 8, "rfilter": {"type": "box"},
                "pixel_format": "luminance"}},
            "wall": {"type": "rectangle", "to_world": wall, "bsdf": {
                "type": "bumpmap", "relief": {"type": "tissue_relief", "slope": 0.05},
                "bsdf": {"type": "diffuse", "reflectance": vessels}}},
        })  # fmt: skip
        return float(np.array(mi.render(scene, spp=16)).mean())

    fov = np.tan(np.radians(25)) * 10
    x, y = np.meshgrid(np.linspace(-fov, fov, 600), np.linspace(-fov, fov, 400) * 8 / 12)
    density = vessel_density(tuple(_placed(np.stack([x, y, 10 + 0 * x]).reshape(3, -1), 0)), 2.0)
    weight = float(np.array(ABSORPTION) @ [0.2126, 0.7152, 0.0722])
    expected = 1 - 0.5 * weight * float(density.mean())
    assert mean_light(0.5) / mean_light(0.0) == pytest.approx(expected, abs=0.01)


def test_a_spectral_variant_is_refused() -> None:
    """Oracle: the message; vessels have no spectra."""
    from mitsuba_endo import backend
    from mitsuba_endo.errors import InputError

    try:
        backend.use("llvm_ad_spectral")
    except InputError as error:
        pytest.skip(str(error))
    import mitsuba as mi

    try:
        with pytest.raises(RuntimeError, match="RGB or monochromatic"):
            mi.load_dict({"type": "vessels"})
    finally:
        backend.use("llvm_ad_rgb")
