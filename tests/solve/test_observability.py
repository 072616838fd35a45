"""What counts as measured, and how free directions are named."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.inference.observability import (
    Unknown,
    advice,
    correlation,
    free_directions,
    is_flat,
    status_of,
    unknowns,
)
from mitsuba_endo.solve.unknowns.layout import Layout, make_layout
from tests.solve.problems import POSE, rig_file, small_rig, true_intrinsics

RIG = small_rig("pinhole")


DISTANCE = 11.0
"""Of the surface, baselines."""


def named(frames: int = 1, **share: str) -> tuple[list[Unknown], Layout]:
    layout = make_layout(rig_file(RIG, share=share), frames)
    known = true_intrinsics(RIG.projector)
    values = {name: [known[name]] * frames for name in ("focal", "centre", "aspect")}
    values["camera_pose"] = [RigidTransform.identity()] * frames
    values["projector_pose"] = [POSE] * frames
    state = layout.state([np.ones(4)] * layout.surfaces, values)
    return unknowns(layout, state, DISTANCE), layout


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
    """Oracle: the layout's slots; a frame is named only where there are several."""
    names, layout = named(centre="shared", distortion="shared", aspect="shared")
    assert len(names) == layout.columns
    assert [u.words for u in names] == [
        *(f"projector pose (rotation about {a})" for a in "xyz"),
        "projector pose (translation direction 1)", "projector pose (translation direction 2)",
        "focal length", "projector centre (x)", "projector centre (y)", "aspect ratio",
        "projector distortion (k1)", "projector distortion (k2)",
    ]  # fmt: skip
    assert [u.scale for u in names][6:8] == pytest.approx([330, 330])
    names, layout = named(2)
    words = [u.words for u in names]
    assert "camera pose (translation z) of frame 2" in words
    assert "focal length" in words
    assert len(words) == layout.columns
    scales = {u.words: u.scale for u in names}
    assert scales["camera pose (translation z) of frame 2"] == DISTANCE
    assert scales["camera pose (rotation about x) of frame 2"] == 1
    assert scales["projector pose (translation z) of frame 2"] == 1


class TestFreeDirections:
    def test_name_what_moves_together(self):
        """Oracle: a covariance built from one long axis through log f and centre x."""
        names, _ = named(centre="shared")
        scale = np.array([u.scale for u in names])
        v = np.zeros(len(names))
        v[5], v[6], v[0] = 0.6, -0.8, 0.01
        covariance = np.outer(scale, scale) * (0.03**2 * np.outer(v, v) + 1e-8 * np.eye(len(v)))
        (found,) = free_directions(covariance, names)
        assert found.std == pytest.approx(0.03, rel=1e-3)
        assert found.mixes == ["projector centre (x)", "focal length"]

    def test_name_what_a_long_one_drags_along(self):
        """Oracle: a tenth of a direction known to 30 % leaves an unknown 3 % weak."""
        names, _ = named(centre="shared")
        scale = np.array([u.scale for u in names])
        v = np.zeros(len(names))
        v[6], v[5], v[1] = 1.0, 0.1, 0.01
        covariance = np.outer(scale, scale) * (0.3**2 * np.outer(v, v) + 1e-8 * np.eye(len(v)))
        (found,) = free_directions(covariance, names)
        assert found.mixes == ["projector centre (x)", "focal length"]

    def test_are_sorted_and_none_where_all_is_known(self):
        """Oracle: a diagonal covariance."""
        names, _ = named()
        sigma = np.array([1e-4, 0.02, 1e-4, 1e-4, 0.5, 1e-4])
        found = free_directions(np.diag(sigma**2), names)
        assert [d.std for d in found] == pytest.approx([0.5, 0.02])
        assert found[0].mixes == ["projector pose (translation direction 2)"]
        assert free_directions(np.diag(np.full(6, 1e-6)), names) == []
        assert free_directions(np.zeros((0, 0)), []) == []


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
        names, _ = named(centre="shared")
        mixing = np.random.default_rng(3).normal(size=(8, 8)) * [1, 2, 3, 40, 5, 6, 7, 800]
        found = correlation(mixing.T @ mixing, names)
        assert found is not None
        cosines = mixing / np.linalg.norm(mixing, axis=0)
        np.testing.assert_allclose(found["matrix"], cosines.T @ cosines, atol=6e-5)
        assert found["unknowns"] == [n.words for n in names]

    def test_leaves_out_what_has_no_variance(self):
        """Oracle: an unknown with no variance, or an infinite one, correlates with nothing."""
        names, _ = named()
        variance = np.array([1.0, 0.0, np.inf, 4.0, 1.0, 1.0])
        found = correlation(np.diag(variance), names)
        assert found is not None
        expected = np.eye(6).astype(object)
        expected[[1, 2]], expected[:, [1, 2]] = None, None
        assert found["matrix"] == expected.tolist()

    def test_of_too_many_unknowns_is_not_recorded(self):
        """Oracle: eleven frames have more than sixty unknowns."""
        names, _ = named(11)
        assert len(names) > 60
        assert correlation(np.eye(len(names)), names) is None
        assert correlation(np.zeros((0, 0)), []) is None
