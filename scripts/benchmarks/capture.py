"""Simulated photographs: a plane against its closed form, noise against formulas, blur, cost."""

from collections.abc import Iterator
from functools import partial
from time import process_time

import numpy as np

from mitsuba_endo.capture.effects import apply_effects
from mitsuba_endo.capture.effects.defocus import defocus
from mitsuba_endo.capture.effects.sensor_noise import sensor_noise
from mitsuba_endo.capture.effects.speckle import speckle
from mitsuba_endo.capture.photograph import photograph
from mitsuba_endo.capture.settings import CaptureSettings, Effects, Light
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.shapes import make_shape

from .line_spread import line_spread
from .plane_under_grid import plane_under_grid
from .report import Figure

NAME = "capture"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Measure all of it; ``quick`` takes smaller images and fewer samples."""
    return [
        *_plane(quick), *_noise(), *_speckle(), *_defocus(), *_spread(quick), *_cost(quick)
    ]  # fmt: skip


def _plane(quick: bool) -> Iterator[Figure]:
    setup = plane_under_grid(*((96, 70) if quick else (320, 240)))
    taken = photograph(
        setup.mesh, setup.camera, RigidTransform.identity(), setup.projector, setup.pose,
        setup.grid.image(), setup.settings(32 if quick else 64), 0,
        pattern_size=(setup.grid.width, setup.grid.height),
    ).radiance[..., 1]  # fmt: skip
    expected = setup.radiance()[..., 1]
    error = np.abs(taken - expected) / expected.max()
    yield _figure("plane under the grid, median error", float(np.median(error)),
                  "of full scale", "lower", 0.01)  # fmt: skip
    yield _figure("plane under the grid, 95th percentile", float(np.percentile(error, 95)),
                  "of full scale", "lower")  # fmt: skip
    yield _figure("plane under the grid, total light", float(taken.sum() / expected.sum()),
                  "of the closed form", "")  # fmt: skip


def _noise() -> Iterator[Figure]:
    full_well, read = 4000.0, 12.0
    levels = np.array([0.01, 0.05, 0.2, 0.5, 0.8])
    measured = [
        float(sensor_noise(np.full((600, 800, 1), s, np.float32), full_well, read,
                           np.random.default_rng(i)).var())
        for i, s in enumerate(levels)
    ]  # fmt: skip
    formula = levels / full_well + (read / full_well) ** 2
    yield _figure("shot and read noise, variance", float(np.abs(measured / formula - 1).max()),
                  "worst relative error", "lower", 0.02)  # fmt: skip


def _speckle() -> Iterator[Figure]:
    contrasts, grains = [], []
    for contrast, grain in ((0.2, 2.0), (0.5, 3.0), (1.0, 4.0)):
        field = speckle((1000, 1000), contrast, grain, np.random.default_rng(7))
        contrasts.append(abs(float(field.std() / field.mean()) / contrast - 1))
        grains.append(abs(_grain(field) / grain - 1))
    yield _figure("speckle contrast", max(contrasts), "worst relative error", "lower", 0.02)
    yield _figure("speckle grain", max(grains), "worst relative error", "lower", 0.05)


def _grain(field: np.ndarray) -> float:
    """Return the full width at half maximum of the autocovariance, by its power spectrum."""
    power = np.abs(np.fft.rfft2(field - field.mean())) ** 2
    row = np.fft.irfft2(power, field.shape)[0, :16]
    distance = np.linspace(0, 15, 1501)
    # Splines would ring; between whole pixels a Gaussian is straight in distance^2 and logarithm.
    log = np.log(np.maximum(row / row[0], 1e-3))
    covariance = np.interp(distance**2, np.arange(16) ** 2, log)
    return 2 * float(distance[np.argmax(covariance < np.log(0.5))])


def _defocus() -> Iterator[Figure]:
    errors = []
    offset = np.arange(81) - 40
    for sigma in (0.8, 1.5, 4.0):
        point = np.zeros((81, 81, 1), np.float32)
        point[40, 40] = 1
        spread = defocus(point, sigma)[..., 0].sum(0)
        errors.append(abs(float(np.sqrt((spread * offset**2).sum()) / sigma) - 1))
    yield _figure("defocus, standard deviation", max(errors), "worst relative error", "lower", 0.02)


def _spread(quick: bool) -> Iterator[Figure]:
    path_mm = 0.5
    medium = line_spread("medium", path_mm, 64 if quick else 256)
    for mode in ("blur", "none"):
        profile = line_spread(mode, path_mm, 8)
        misplaced = float(np.abs(profile - medium).sum() / 2)
        yield _figure(f"line on tissue, {mode} against medium, misplaced light", misplaced,
                      "of all", "lower")  # fmt: skip
        yield _figure(f"line on tissue, {mode} against medium, peak",
                      float(profile.max() / medium.max()), "ratio", "")  # fmt: skip


def _cost(quick: bool) -> Iterator[Figure]:
    width, height = (160, 120) if quick else (320, 240)
    focal = 0.625 * width
    K = np.array([[focal, 0, 0.49 * width], [0, focal, 0.51 * height], [0, 0, 1]])
    camera, mesh, grid = CameraModel("opencv", width, height, K), make_shape("colon"), CodedGrid()
    pattern, taken = grid.image(), None
    for name, lamp in (("laser", 0.0), ("laser and lamp", 0.3)):
        settings = CaptureSettings(light=Light(lamp=lamp))
        spent = []
        for seed in range(3):  # the first compiles
            began = process_time()
            taken = photograph(
                mesh, camera, RigidTransform.identity(),
                projector_model("direction_cosine", 400.0, (239.5, 191.5)),
                RigidTransform.of([0.03, -0.05, 0.05], [-5.0, 1.2, 1.0]), pattern, settings, seed,
                pattern_size=(grid.width, grid.height),
            )  # fmt: skip
            spent.append(process_time() - began)
        yield _figure(f"colon, {width} x {height}, 16 samples, {name}", min(spent),
                      "s of one core", "lower")  # fmt: skip
    assert taken is not None
    for name, image in (("colour", taken.radiance), ("gray", taken.radiance[..., 1])):
        spent = []
        for seed in range(10):
            began = process_time()
            apply_effects(image, Effects(), seed)
            spent.append(1000 * (process_time() - began))
        yield _figure(f"camera effects, {width} x {height}, {name}", min(spent), "ms of one core",
                      "lower", 20 if name == "gray" else None)  # fmt: skip
