"""Do the stated standard deviations agree with the scatter over noise? By simulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.solve.costs.objective import Problem, evaluate
from mitsuba_endo.solve.elimination.normal_equations import NormalEquations
from mitsuba_endo.solve.inference.covariance import uncertainty
from mitsuba_endo.solve.minimisers.minimise import minimise
from mitsuba_endo.solve.minimisers.surface_smoothing import smooth_surfaces
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.surfaces.inverse_range_lattice import Lattice
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import Rig, bumpy_sheet, lopsided_camera, random_rig, with_noise, with_outliers
from tests.solve.problems import NOISE, errors, problem_of, small_rig

FIELD = bumpy_sheet(70, (0.2, -0.15), 3, 3)
"""Relief of the scene that is measured again and again."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Estimates from simulated noise, one row for each."""

    error: NDArray[np.float64]
    """(K, G) estimate minus truth."""
    formal: NDArray[np.float64]
    """(K, G) formal standard deviations."""
    jackknife: NDArray[np.float64]
    """(K, G)."""
    sigma: NDArray[np.float64]
    """(K, 1) estimated over true noise."""
    bound: NDArray[np.float64]
    """(K, G) Cramer-Rao bounds of the standard deviation."""
    depth_error: NDArray[np.float64]
    """(K, P) relative error of the inverse range at vertices, NaN outside the map."""
    depth_std: NDArray[np.float64]
    """(K, P) stated."""

    @property
    def figures(self) -> dict[str, float]:
        """What is quoted, all unknowns pooled."""
        z = self.error / self.formal
        stated = np.maximum(self.formal, self.jackknife)
        return {
            "error over formal std, RMS": _rms(z),
            "error over Cramer-Rao bound, RMS": _rms(self.error / self.bound),
            "95 % interval covers, %": 100 * float(np.mean(np.abs(self.error) < 1.96 * stated)),
            "the same, formal, %": 100 * float(np.mean(np.abs(z) < 1.96)),
            "jackknife over formal std, RMS": _rms(self.jackknife / self.formal),
            "noise estimate over truth": float(np.mean(self.sigma)),
            "depth error over its std, RMS": _rms(self.depth_error / self.depth_std),
            "depth error, RMS, %": 100 * _rms(self.depth_error),
        }


def one_scene(law: str, seeds: int, outliers: float = 0.0) -> Sample:
    """Measure one scene again and again; the seed is that of the noise."""
    rig = small_rig(law, FIELD)
    return _sample([(rig, seed) for seed in range(seeds)], outliers)


def many_scenes(seeds: int) -> Sample:
    """Measure random rigs, half of each law or so, once each."""
    camera = lopsided_camera(96, 80)
    return _sample([(random_rig(seed, camera), seed) for seed in range(seeds)], 0.0)


def _sample(cases: list[tuple[Rig, int]], outliers: float) -> Sample:
    rows = [_measure(rig, seed, outliers) for rig, seed in cases]
    return Sample(*(_stack([row[i] for row in rows]) for i in range(7)))


def _measure(rig: Rig, seed: int, outliers: float) -> list[NDArray[np.float64]]:
    noisy = with_outliers(with_noise(rig, NOISE, seed), outliers, seed)
    result = minimise(*problem_of([noisy]), Options())
    reported = smooth_surfaces(result, Options())
    known = uncertainty(result, reported, jackknife=True)
    assert known.jackknife is not None
    lattice = result.problem.surfaces[0]
    assert isinstance(lattice, Lattice)
    true_rho = _true_rho(rig, lattice.directions)
    return [
        errors(result, rig), np.sqrt(np.diag(known.formal)), np.sqrt(np.diag(known.jackknife)),
        np.array(known.sigma / NOISE), _bound(*problem_of([rig])),
        reported.state.surfaces[0] / true_rho - 1, known.surface_std[0] / true_rho,
    ]  # fmt: skip


def _true_rho(rig: Rig, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse ranges in baselines at ``directions``, interpolated in the rig's depth image."""
    x, y = np.moveaxis(rig.camera.project(directions), -1, 0)
    height, width = rig.depth.shape
    inside = (directions[:, 2] > 0.1) & (x >= 0) & (y >= 0) & (x < width - 1) & (y < height - 1)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    i, j = y.astype(int), x.astype(int)
    fx, fy = x - j, y - i
    inverse = 1 / rig.depth
    value = (
        inverse[i, j] * (1 - fx) * (1 - fy) + inverse[i, j + 1] * fx * (1 - fy)
        + inverse[i + 1, j] * (1 - fx) * fy + inverse[i + 1, j + 1] * fx * fy
    )  # fmt: skip
    return np.where(inside, value * rig.baseline, np.nan)


def _bound(problem: Problem, state: State) -> NDArray[np.float64]:
    """Return the Cramer-Rao bound (G,) for a lattice surface of which nothing is known."""
    layout = problem.layout
    normal = NormalEquations.empty(problem.surfaces, layout.columns)
    lin = evaluate(problem, state).linearisation(0)
    normal.add_frame(
        0, lin, np.zeros_like(lin.values), np.ones(len(lin.hit)), layout.local_from_global(state, 0)
    )
    operator = problem.smoothness[0].bending.operator
    block = normal.surfaces[0]
    block.A = block.A + 1e-6 * (operator.T @ operator)  # holds vertices without data
    return NOISE * np.sqrt(np.diag(np.linalg.inv(normal.reduce().S)))


def _stack(rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Stack rows of which some are shorter, padded with NaN."""
    out = np.full((len(rows), max(r.size for r in rows)), np.nan)
    for row, values in zip(out, rows, strict=True):
        row[: values.size] = values
    return out


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
