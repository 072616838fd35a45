"""The limits of consistency. Oracle: tables, formulas; whole solves are in ``test_bad_frames``."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform, rotation_from_vector, tangent_basis
from mitsuba_endo.solve.inference.fit import FrameSolution
from mitsuba_endo.solve.inference.frame_consistency import Consistency, chance, worst
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.unknowns.layout import make_layout
from tests.solve.problems import rig_file, small_rig

RIGHT = Consistency("right", 0.9, 1.03, 0.01)
FOLDS = Consistency("folds", 1.0, 1.2, 0.2)
STRAY = Consistency("stray", 0.15, 1.05, 0.0)
ALONE = Consistency("alone", 0.0, np.inf, 0.0)
OTHER = Consistency("other", 0.7, 9.0, 0.6)
WORSE = Consistency("worse", 0.7, 20.0, 0.6)
SPOTTED = Consistency("spotted", 0.8, 1.1, 0.5)


@pytest.mark.parametrize("frame", [STRAY, ALONE, OTHER, SPOTTED], ids=lambda a: a.name)
def test_wrong(frame: Consistency) -> None:
    assert frame.wrong
    assert worst([RIGHT, frame, FOLDS]) == 1
    assert "inf" not in frame.reason
    assert f"{100 * frame.common:.0f} %" in frame.reason


def test_right() -> None:
    assert worst([RIGHT, FOLDS]) is None
    assert not RIGHT.doubtful
    assert Consistency("between", 0.9, 1.5, 0.1).doubtful


def test_strays_go_first_then_the_worst() -> None:
    """A stray hardly disturbs and is certain; the larger misfit is the stranger."""
    assert worst([OTHER, STRAY, WORSE]) == 1
    assert worst([OTHER, RIGHT, WORSE]) == 2


RECORD = rig_file(small_rig("pinhole"))
"""One surface, poses per frame, one focal length, the rest fixed."""
TURN, MOVE, FOCAL = 1e-4, 5e-4, 2e-4
"""Standard deviations of the frame alone: radians, baselines, relative."""
POSE = RigidTransform.of([0.03, -0.1, 0.05], [-0.9, 0.1, 0.42])


def moved(step: list[float], focal: float = 0.0, **deviations: float) -> float:
    """Chance of a joint solution that is some standard deviations from the frame alone."""
    own = RigidTransform(POSE.R, POSE.t / np.linalg.norm(POSE.t))
    sizes = {"turn": TURN, "move": MOVE, **deviations}
    std = np.array([sizes["turn"]] * 3 + [sizes["move"]] * 2 + [FOCAL])
    layout = make_layout(RECORD, 2)
    one = {"projector_pose": [own], "focal": [np.zeros(1)]}
    alone = SimpleNamespace(
        state=layout.alone().state([np.zeros(0)], one), information=np.diag(std**-2.0)
    )
    t = own.t + tangent_basis(own.t) @ np.array(step[3:]) * MOVE
    joint = RigidTransform(rotation_from_vector(np.array(step[:3]) * TURN) @ own.R, 1.07 * t)
    here = RigidTransform.identity()
    both = {
        "camera_pose": [here, here],
        "projector_pose": [own, joint],
        "focal": [np.array([focal * FOCAL])] * 2,
    }
    at = SimpleNamespace(
        problem=SimpleNamespace(layout=layout), state=layout.state([np.zeros(0)], both)
    )
    return chance(cast(FrameSolution, alone), cast(OptimisationResult, at), 1)


def test_chance_of_a_difference() -> None:
    """Oracle: the chi-square distribution of six unknowns, from its closed form for six degrees."""

    def six(x: float) -> float:
        return float(np.exp(-x / 2) * (1 + x / 2 + (x / 2) ** 2 / 2))

    assert moved([0, 0, 0, 0, 0]) == pytest.approx(1)
    assert moved([1, 0, 0, 0, 0]) == pytest.approx(six(1), rel=1e-3)
    assert moved([0, -2, 1, 3, 0], focal=-1) == pytest.approx(six(15), rel=1e-2)
    assert moved([0, 0, 0, 0, 0], focal=6) == pytest.approx(six(36), rel=1e-3)


def test_unknowns_that_a_frame_hardly_knows_are_not_compared() -> None:
    """Oracle: five deviations along directions whose deviation is one percent do not count."""
    assert moved([0, 0, 0, 100, 0], move=0.01) > 0.9
    assert moved([8, 0, 0, 100, 0], move=0.01) < 1e-9


def test_contradiction_is_a_doubt_and_says_so() -> None:
    found = Consistency("frame", 0.5, 1.01, 0.0, chance=1e-6)
    assert found.doubtful
    assert not found.wrong
    assert "alone it gives another projector pose" in found.reason
    assert "1e-06" in found.reason
    assert not Consistency("frame", 0.5, 1.01, 0.0, chance=0.02).doubtful


def test_frames_that_all_fit_alike_are_not_each_accused():
    """Oracle: of four frames with one ratio none is named; a single one is, with what to do."""
    from mitsuba_endo.solve.inference.frame_consistency import Consistency, doubtful_frames

    names = ["a", "b", "c", "d"]
    all_alike = [Consistency(name, 0.9, ratio, 0.0)
                 for name, ratio in zip(names, (1.32, 1.5, 1.4, 1.35), strict=True)]  # fmt: skip
    (said,) = doubtful_frames(all_alike)
    assert said.startswith("4 of 4 frames fit the common surface 1.3 to 1.5 times worse than")
    assert "share surface=per_frame" in said
    one = [Consistency("a", 0.9, 1.5, 0.0), *(Consistency(n, 0.9, 1.0, 0.0) for n in names[1:])]
    (said,) = doubtful_frames(one)
    assert said.startswith("do not rely on frame a:")
    assert said.endswith("the other poses are told from its camera, so calibrate without it")
    (said,) = doubtful_frames([one[1], one[0], one[2]])
    assert said.endswith("calibrate without it if you need the others' best values")


class _Plan:
    """A layout, as far as it says how projector poses are shared."""

    def __init__(self, mode: str) -> None:
        self.mode = mode

    def sharing(self, name: str) -> str:
        assert name == "projector_pose"
        return self.mode


def test_a_plan_that_most_frames_contradict_is_accused_at_once():
    """Oracle: by hand: 11 of 20 frames contradict; of 5 one does, and is left out; after a tenth
    was left out the next one accuses the plan; a plan that ties nothing is never accused."""
    from mitsuba_endo.solve.inference.frame_consistency import Consistency, plan_refuted

    def judged(wrong: int, right: int) -> list[Consistency]:
        ratios = [4.0] * wrong + [1.0] * right
        return [Consistency(f"f{k}", 0.9, ratio, 0.0) for k, ratio in enumerate(ratios)]

    shared: Any = _Plan("shared")
    said = plan_refuted(judged(11, 9), shared, 0)
    assert said.startswith("with one projector pose for all, 11 of 20 frames")
    assert "--share projector_pose=per_frame" in said
    assert plan_refuted(judged(1, 4), shared, 0) == ""
    assert plan_refuted(judged(1, 17), shared, 1) == ""
    assert plan_refuted(judged(1, 17), shared, 2).startswith("with one projector pose for all")
    own: Any = _Plan("per_frame")
    assert plan_refuted(judged(20, 0), own, 5) == ""
