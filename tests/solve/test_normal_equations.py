"""Normal equations by elimination against the dense system."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.costs.noise_scale import NoiseScale
from mitsuba_endo.solve.costs.objective import Problem, evaluate, make_problem
from mitsuba_endo.solve.costs.term import Gradient
from mitsuba_endo.solve.elimination.normal_equations import NormalEquations
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.surfaces.inverse_range_lattice import lattice_over
from mitsuba_endo.solve.unknowns.block import BLOCKS
from mitsuba_endo.solve.unknowns.layout import make_layout
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import bumpy_sheet, with_noise, with_outliers
from tests.solve.problems import problem_of, rig_file, small_rig

FIRST = with_outliers(with_noise(small_rig("direction_cosine"), 0.3, 0), 0.02, 0)
SECOND = with_noise(small_rig("direction_cosine", bumpy_sheet(60, (-0.1, 0.2), 5, 7)), 0.3, 1)


def problem(shared_surface: bool, **share: str) -> tuple[Problem, State]:
    """Two frames on coarse lattices; with one surface the second camera has moved a little."""
    rigs = [FIRST, FIRST if shared_surface else SECOND]
    record = rig_file(FIRST, share={"surface": "per_frame", **share})
    built, state = problem_of(rigs, record, options=Options(cell_px=9))
    if not shared_surface:
        return built, state
    layout = make_layout(rig_file(FIRST, share=share), 2)
    values = {name: [state.at(name, k) for k in (0, 1)] for name in BLOCKS}
    moved = RigidTransform.of([0.01, -0.02, 0.01], [0.05, -0.03, 0.02])
    values["camera_pose"] = [RigidTransform.identity(), moved]
    state = layout.state(state.surfaces[:1], values)
    smooth = built.smoothness[:1]
    return make_problem(built.observed, built.surfaces[:1], state, layout, built.law, smooth), state


def dense(built: Problem, noise: NoiseScale, at_state: State) -> tuple[np.ndarray, np.ndarray]:
    """H and g of all unknowns, surfaces first, from rows written out in full."""
    layout = built.layout
    at = evaluate(built, at_state)
    sizes = [len(r) for r in at_state.surfaces]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    H = np.zeros((starts[-1] + layout.columns,) * 2)
    g = np.zeros(len(H))
    for k, (lin, seen, w) in enumerate(
        zip(at.linearisations(), at.frames, at.weights(noise), strict=True)
    ):
        for c in (0, 1):
            J = np.zeros((len(w), len(H)))
            first = starts[layout.surface_of[k]]
            for corner in range(3):
                J[np.arange(len(w)), first + lin.triangles[:, corner]] += lin.J_surface[c, corner]
            J[:, starts[-1] :] = lin.J_local[c].T @ layout.local_from_global(at_state, k)
            H += (J.T * w) @ J
            g += J.T @ (w * seen.residual[c])
    smooth = Gradient([np.zeros(n) for n in sizes], np.zeros(layout.columns))
    for s, term in enumerate(built.smoothness):
        term.accumulate_gradient(smooth, at_state, noise)
        part = slice(starts[s], starts[s + 1])
        H[part, part] += term.hessian(at_state, noise).toarray()
        g[part] += smooth.surfaces[s]
    return H, g


CASES = [
    (False, {}),
    (False, {"projector_pose": "shared", "centre": "shared"}),
    (True, {}),
    (True, {"focal": "per_frame", "distortion": "shared"}),
]


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize(("shared", "share"), CASES)
def test_equal_the_dense_system(shared: bool, share: dict):
    """Oracle: numpy.linalg.solve of the damped system; the Schur complement from the inverse."""
    built, state = problem(shared, **share)
    noise = NoiseScale(0.3, "tukey", last=True)
    normal = evaluate(built, state).normal_equations(noise)
    H, g = dense(built, noise, state)
    n = len(H) - built.layout.columns
    mu = 1e-2
    # Vertices without data have no information but a floor of 1e-12 of the largest.
    floor = np.zeros(len(H))
    first = 0
    for block in normal.surfaces:
        floor[first : first + len(block.g)] = 1e-12 * max(1.0, block.A.diagonal().max())
        first += len(block.g)
    expected = -np.linalg.solve(H + np.diag(mu * np.diag(H) + floor), g)
    step = normal.solve(mu)
    scale = np.sqrt(np.diag(H))
    np.testing.assert_allclose(
        step.unknowns * scale[n:], expected[n:] * scale[n:], rtol=1e-6, atol=1e-9
    )
    found = np.concatenate(step.surfaces)
    np.testing.assert_allclose(
        found * scale[:n],
        expected[:n] * scale[:n],
        rtol=1e-6,
        atol=1e-7 * abs(found * scale[:n]).max(),
    )
    S = normal.reduce().S
    full = H[n:, n:] - H[n:, :n] @ np.linalg.solve(H[:n, :n] + np.diag(floor[:n]), H[:n, n:])
    outer = np.outer(scale[n:], scale[n:])
    np.testing.assert_allclose(S / outer, full / outer, atol=1e-9)
    np.testing.assert_allclose(normal.undamped()[1], S)


PATCH = lattice_over(np.array([[0.0, 0, 1]]), 0.05, margin=0)
"""One cell, four vertices."""


def test_terms_over_global_unknowns_add_up(llvm: str):
    """Oracle: D and g grow by what is added, twice if added twice."""
    normal = NormalEquations.empty([PATCH], 2)
    normal.add_global(np.array([[2.0, 1], [1, 3]]), np.array([1.0, -1]))
    normal.add_global(np.array([[2.0, 1], [1, 3]]), np.array([1.0, -1]))
    np.testing.assert_array_equal(normal.D, [[4, 2], [2, 6]])
    np.testing.assert_array_equal(normal.g, [2, -2])


def test_directions_without_information_stay_put(llvm: str):
    """Oracle: the minimum-norm step of a singular system; no information at all is an error."""
    normal = NormalEquations.empty([PATCH], 2)
    normal.surfaces[0].A = normal.surfaces[0].A + np.eye(4)
    normal.add_global(np.array([[1.0, 1], [1, 1]]), np.array([2.0, 2]))
    np.testing.assert_allclose(normal.solve(0.0).unknowns, [-1, -1])
    np.testing.assert_allclose(normal.undamped()[0], [-1, -1])
    empty = NormalEquations.empty([PATCH], 2)
    empty.surfaces[0].A = empty.surfaces[0].A + np.eye(4)
    with pytest.raises(np.linalg.LinAlgError):
        empty.solve(0.0)
