"""What counts as measured, and how free directions are named."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.statistics.observability import (
    advice,
    correlation,
    free_directions,
    is_flat,
    status_of,
    unknowns,
)
from mitsuba_endo.solve.unknowns.plan import make_plan
from mitsuba_endo.solve.unknowns.state import State, intrinsics_vector
from tests.solve.problems import POSE, rig_file, small_rig

RIG = small_rig("pinhole")


def named(frames: int = 1, **share: str):
    plan = make_plan(rig_file(RIG, share=share), frames)
    state = State(
        [np.ones(4)], [RigidTransform.identity()] * frames, [POSE] * frames,
        [intrinsics_vector(RIG.projector)] * frames,
    )  # fmt: skip
    return unknowns(plan, state), plan


@pytest.mark.parametrize(
    ("std", "scale", "status"),
    [
        (0.0099, 1.0, "measured"), (0.0101, 1.0, "weak"), (0.099, 1.0, "weak"),
        (0.101, 1.0, "unobservable"), (3.2, 330.0, "measured"), (3.4, 330.0, "weak"),
        (34.0, 330.0, "unobservable"), (np.nan, 1.0, "unobservable"), (np.inf, 1.0, "unobservable"),
    ],
)  # fmt: skip
def test_status(std: float, scale: float, status: str):
    """Oracle: one and ten percent of the natural scale; what is no number is not known."""
    assert status_of(std / scale) == status


def test_unknowns_stand_in_the_order_of_the_columns():
    """Oracle: the plan's slots; a frame is named only where there are several."""
    names, plan = named(centre="shared", distortion="shared", aspect="shared")
    assert len(names) == plan.columns
    assert [u.words(plan) for u in names] == [
        *(f"projector pose (rotation about {a})" for a in "xyz"),
        "projector pose (translation direction 1)", "projector pose (translation direction 2)",
        "focal length", "projector centre (x)", "projector centre (y)", "aspect ratio",
        "projector distortion (k1)", "projector distortion (k2)",
    ]  # fmt: skip
    assert [u.scale for u in names][6:8] == pytest.approx([330, 330])
    names, plan = named(2)
    words = [u.words(plan) for u in names]
    assert "camera pose (translation z) of frame 2" in words
    assert "focal length" in words
    assert len(words) == plan.columns


class TestFreeDirections:
    def test_name_what_moves_together(self):
        """Oracle: a covariance built from one long axis through log f and centre x."""
        names, plan = named(centre="shared")
        scale = np.array([u.scale for u in names])
        v = np.zeros(len(names))
        v[5], v[6], v[0] = 0.6, -0.8, 0.01
        covariance = np.outer(scale, scale) * (0.03**2 * np.outer(v, v) + 1e-8 * np.eye(len(v)))
        (found,) = free_directions(covariance, names, plan)
        assert found.std == pytest.approx(0.03, rel=1e-3)
        assert found.mixes == ["projector centre (x)", "focal length"]

    def test_name_what_a_long_one_drags_along(self):
        """Oracle: a tenth of a direction known to 30 % leaves an unknown 3 % weak."""
        names, plan = named(centre="shared")
        scale = np.array([u.scale for u in names])
        v = np.zeros(len(names))
        v[6], v[5], v[1] = 1.0, 0.1, 0.01
        covariance = np.outer(scale, scale) * (0.3**2 * np.outer(v, v) + 1e-8 * np.eye(len(v)))
        (found,) = free_directions(covariance, names, plan)
        assert found.mixes == ["projector centre (x)", "focal length"]

    def test_are_sorted_and_none_where_all_is_known(self):
        """Oracle: a diagonal covariance."""
        names, plan = named()
        sigma = np.array([1e-4, 0.02, 1e-4, 1e-4, 0.5, 1e-4])
        found = free_directions(np.diag(sigma**2), names, plan)
        assert [d.std for d in found] == pytest.approx([0.5, 0.02])
        assert found[0].mixes == ["projector pose (translation direction 2)"]
        assert free_directions(np.diag(np.full(6, 1e-6)), names, plan) == []
        assert free_directions(np.zeros((0, 0)), [], plan) == []


def test_advice_tells_cases_apart():
    """Oracle: theory; the plane is blamed only where it is the reason."""
    assert "centre" in advice({"centre", "focal"}, "pinhole", True)
    assert "planar" in advice({"focal"}, "pinhole", True)
    assert "planar" not in advice({"focal"}, "direction_cosine", True)
    assert "planar" not in advice({"focal"}, "pinhole", False)
    assert "frames" in advice({"camera_pose"}, "pinhole", False)
    assert "relief" in advice({"projector_pose"}, "pinhole", False)


def test_flatness():
    """Oracle: 1 % and 5 % of relief over the shorter side, tilted."""
    rng = np.random.default_rng(0)
    for relief, flat in ((0.01, True), (0.05, False)):
        points = rng.normal(size=(2000, 3)) * [30, 20, 20 * relief]
        assert is_flat(RigidTransform.of([0.3, -0.5, 0.2], [5, 6, 70]).apply(points)) == flat


class TestCorrelation:
    def test_is_free_of_units(self):
        """Oracle: cosines between the columns of a square root of the covariance."""
        names, plan = named(centre="shared")
        mixing = np.random.default_rng(3).normal(size=(8, 8)) * [1, 2, 3, 40, 5, 6, 7, 800]
        found = correlation(mixing.T @ mixing, names, plan)
        assert found is not None
        cosines = mixing / np.linalg.norm(mixing, axis=0)
        np.testing.assert_allclose(found["matrix"], cosines.T @ cosines, atol=6e-5)
        assert found["unknowns"] == [n.words(plan) for n in names]

    def test_leaves_out_what_has_no_variance(self):
        """Oracle: an unknown with no variance, or an infinite one, correlates with nothing."""
        names, plan = named()
        variance = np.array([1.0, 0.0, np.inf, 4.0, 1.0, 1.0])
        found = correlation(np.diag(variance), names, plan)
        assert found is not None
        expected = np.eye(6).astype(object)
        expected[[1, 2]], expected[:, [1, 2]] = None, None
        assert found["matrix"] == expected.tolist()

    def test_of_too_many_unknowns_is_not_recorded(self):
        """Oracle: eleven frames have more than sixty unknowns."""
        names, plan = named(11)
        assert len(names) > 60
        assert correlation(np.eye(len(names)), names, plan) is None
        assert correlation(np.zeros((0, 0)), [], plan) is None
