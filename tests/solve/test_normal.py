"""Normal equations by elimination against the dense system."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.cost.normal import NormalEquations
from mitsuba_endo.solve.cost.objective import Objective, evaluate
from mitsuba_endo.solve.cost.problem import Problem
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.prepare.single import separate_surfaces
from mitsuba_endo.solve.unknowns.plan import make_plan
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import bumpy_sheet, with_noise, with_outliers
from tests.solve.problems import map_of, rig_file, small_rig, true_start

FIRST = with_outliers(with_noise(small_rig("direction_cosine"), 0.3, 0), 0.02, 0)
SECOND = with_noise(small_rig("direction_cosine", bumpy_sheet(60, (-0.1, 0.2), 5, 7)), 0.3, 1)


def problem(shared_surface: bool, **share: str) -> tuple[Problem, State]:
    """Two frames on coarse lattices; with one surface the second camera has moved a little."""
    rigs = [FIRST, FIRST] if shared_surface else [FIRST, SECOND]
    mode = "shared" if shared_surface else "per_frame"
    plan = make_plan(rig_file(FIRST, share={"surface": mode, **share}), 2)
    built, state = separate_surfaces(
        [map_of(r, f"{k}.npz") for k, r in enumerate(rigs)], [true_start(r) for r in rigs],
        FIRST.camera, plan, "direction_cosine", Options(cell_px=9),
    )  # fmt: skip
    if shared_surface:
        for renderer in built.renderers:
            renderer.scene = built.surfaces[0].scene
        built.renderers[1].at_centre = False
        built.surfaces = built.surfaces[:1]
        moved = RigidTransform.of([0.01, -0.02, 0.01], [0.05, -0.03, 0.02])
        state = state.with_(rho=state.rho[:1], world_from_camera=[RigidTransform.identity(), moved])
    return built, state


def dense(objective: Objective, at_state: State) -> tuple[np.ndarray, np.ndarray]:
    """H and g of all unknowns, surfaces first, from rows written out in full."""
    built, plan = objective.problem, objective.problem.plan
    at = evaluate(built, at_state)
    sizes = [len(r) for r in at_state.rho]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    H = np.zeros((starts[-1] + plan.columns,) * 2)
    g = np.zeros(len(H))
    for k, (lin, r, w) in enumerate(
        zip(at.linearisations, at.residuals, objective.weights(at), strict=True)
    ):
        for c in (0, 1):
            J = np.zeros((len(w), len(H)))
            first = starts[plan.surface_of(k)]
            for corner in range(3):
                J[np.arange(len(w)), first + lin.triangles[:, corner]] += lin.J_surface[c, corner]
            J[:, starts[-1] :] = lin.J_local[c].T @ plan.local_to_global(at_state, k)
            H += (J.T * w) @ J
            g += J.T @ (w * r[c])
    for s, surface in enumerate(built.surfaces):
        A, b = surface.prior.normal(at_state.rho[s], objective.sigma)
        part = slice(starts[s], starts[s + 1])
        H[part, part] += A.toarray()
        g[part] += b
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
    objective = Objective(built, "tukey", sigma=0.3, stage=1)
    normal = objective.normal_equations(evaluate(built, state))
    H, g = dense(objective, state)
    n = len(H) - built.plan.columns
    mu = 1e-2
    # Vertices without data have no information but a floor of 1e-12 of the largest.
    floor = np.zeros(len(H))
    first = 0
    for block in normal.surfaces:
        floor[first : first + len(block.g)] = 1e-12 * max(1.0, block.A.diagonal().max())
        first += len(block.g)
    expected = -np.linalg.solve(H + np.diag(mu * np.diag(H) + floor), g)
    surfaces, step = normal.solve(mu)
    scale = np.sqrt(np.diag(H))
    np.testing.assert_allclose(step * scale[n:], expected[n:] * scale[n:], rtol=1e-6, atol=1e-9)
    found = np.concatenate(surfaces)
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


def test_terms_over_global_unknowns_add_up(llvm: str):
    """Oracle: D and g grow by what is added, twice if added twice."""
    normal = NormalEquations.empty([3], [1], 2)
    normal.add_global(np.array([[2.0, 1], [1, 3]]), np.array([1.0, -1]))
    normal.add_global(np.array([[2.0, 1], [1, 3]]), np.array([1.0, -1]))
    np.testing.assert_array_equal(normal.D, [[4, 2], [2, 6]])
    np.testing.assert_array_equal(normal.g, [2, -2])


def test_directions_without_information_stay_put(llvm: str):
    """Oracle: the minimum-norm step of a singular system; no information at all is an error."""
    normal = NormalEquations.empty([1], [1], 2)
    normal.surfaces[0].A = normal.surfaces[0].A + np.eye(1)
    normal.add_global(np.array([[1.0, 1], [1, 1]]), np.array([2.0, 2]))
    np.testing.assert_allclose(normal.solve(0.0)[1], [-1, -1])
    empty = NormalEquations.empty([1], [1], 2)
    empty.surfaces[0].A = empty.surfaces[0].A + np.eye(1)
    with pytest.raises(np.linalg.LinAlgError):
        empty.solve(0.0)
