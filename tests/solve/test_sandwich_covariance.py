"""What counts as information, and what only looks like it."""

import numpy as np
import pytest

from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.inference.sandwich_covariance import Information, without_false_information
from tests.rigs import bumpy_sheet, plane, with_noise
from tests.solve.problems import NOISE, SHEET, map_of, rig_file, small_rig

PLANE = plane((0.25, -0.15, 1.0), 70)


def calibrated(law: str, surface, seed: int = 0, **share: str) -> Calibration:
    rig = with_noise(small_rig(law, surface), NOISE, seed)
    return calibrate([map_of(rig)], rig_file(rig, share=share))


@pytest.mark.usefixtures("llvm")
class TestDegenerate:
    """Oracle: theory. A plane does not show a pinhole's focal length, whatever relief noise puts
    on it; one pinhole pair shows seven numbers, and pose, focal length and centre are eight."""

    @pytest.mark.parametrize("seed", [0, 1])
    def test_pinhole_and_plane(self, seed: int):
        found = calibrated("pinhole", PLANE, seed).solution
        focal = found.projector.focal
        assert (focal.status, focal.value) == ("unobservable", None)
        assert focal.reason
        assert "planar" in focal.reason
        assert any(line.startswith("Focal length: not determined") for line in found.verdict)
        assert found.observability["free_directions"]

    def test_pinhole_and_free_centre(self):
        found = calibrated("pinhole", SHEET, centre="shared").solution
        for estimate in (found.projector.focal, found.projector.centre):
            assert (estimate.status, estimate.value) == ("unobservable", None)
            assert estimate.reason
            assert "centre" in estimate.reason
        mixed = found.observability["free_directions"][0]["mixes"]
        assert any("centre" in m for m in mixed)

    def test_pinhole_and_hardly_any_relief(self):
        """Oracle: 0.3 mm of relief; the stated deviation covers the error, and is neither small nor
        more than 3 %: the data do tell something."""
        nearly_flat = bumpy_sheet(70, (0.2, -0.15), 0.3, 3)
        focal = calibrated("pinhole", nearly_flat).solution.projector.focal
        assert focal.status == "weak"
        assert isinstance(focal.value, float)
        assert isinstance(focal.std, float)
        assert abs(focal.value - 330) < 3 * focal.std
        assert 3 < focal.std < 10


@pytest.mark.usefixtures("llvm")
class TestDetermined:
    """Oracle: the truth within four stated deviations, and these are small."""

    def check(self, law: str, surface, **share: str) -> None:
        found = calibrated(law, surface, **share).solution.projector
        assert found.focal.status == "measured"
        assert isinstance(found.focal.value, float)
        assert isinstance(found.focal.std, float)
        assert abs(found.focal.value - 330) < 4 * found.focal.std < 4

    def test_relief(self):
        self.check("pinhole", SHEET)

    def test_direction_cosines_and_plane(self):
        self.check("direction_cosine", PLANE)

    def test_direction_cosines_and_free_centre(self):
        self.check("direction_cosine", SHEET, centre="shared")


class TestExtrapolation:
    def test_subtracts_what_noise_adds(self):
        """Oracle: S = true + c in a direction, noisy = true + 2 c."""
        S = np.diag([100.0, 10.0, 1.0])
        noisy = S + np.diag([10.0, 0.0, 0.0])
        np.testing.assert_allclose(
            without_false_information(S, noisy), np.diag([90.0, 10, 1]), rtol=1e-9
        )

    def test_leaves_nothing_where_noise_outweighs_the_data(self):
        """Oracle: a direction, oblique to the axes, that doubles when noise doubles."""
        v = np.array([0.6, -0.8, 0.0])
        base = np.diag([3.0, 4.0, 5.0])
        along = np.outer(base @ v, base @ v)
        S = base - along / (v @ base @ v) + 0.01 * along
        noisy = S + 0.01 * along
        left = without_false_information(S, noisy)
        assert v @ left @ v < 1e-3 * (v @ S @ v)
        np.testing.assert_allclose(left[2, 2], 5)

    def test_never_adds(self):
        """Oracle: less apparent information under more noise changes nothing."""
        S = np.array([[2.0, 0.5], [0.5, 1.0]])
        np.testing.assert_allclose(without_false_information(S, 0.9 * S), S, rtol=1e-9)


def test_fixed_focal_on_a_plane_is_an_answer(llvm: str):
    """Oracle: with the focal length given, pose and shape of a plane are determined."""
    rig = with_noise(small_rig("pinhole", PLANE), NOISE, 0)
    found = calibrate([map_of(rig)], rig_file(rig, projector={"focal": 330.0})).solution
    assert found.projector.focal.status == "fixed"
    assert found.projector.focal.value == pytest.approx(330, rel=1e-12)
    pose = found.frames[0].projector_from_camera
    np.testing.assert_allclose(pose.t, rig.projector_from_camera.t, atol=0.1)


class TestCovariance:
    KNOWN = np.array([[50.0, 8.0, 0.0], [8.0, 2.0, 0.3], [0.0, 0.3, 4.0]])

    def test_without_noise_on_the_surface(self):
        """Oracle: the inverse."""
        cov = Information(self.KNOWN, self.KNOWN).covariance()
        np.testing.assert_allclose(cov, np.linalg.inv(self.KNOWN), rtol=1e-9)

    def test_of_an_errors_in_variables_line(self):
        """Oracle: the scatter of slopes, simulated.

        y = a x with noise in both and corrected for it: x^2 overstates the information, and the
        score varies by what the noisy x show.
        """
        rng = np.random.default_rng(0)
        x = rng.normal(0, 1.0, 400)
        own, sigma = 0.8, 0.5
        slopes = []
        for _ in range(4000):
            seen = x + own * rng.standard_normal(400)
            y = sigma * rng.standard_normal(400)  # the true slope is zero
            slopes.append(seen @ y / (x @ x))
        known, score = x @ x, x @ x + 400 * own**2
        cov = Information(np.array([[known]]), np.array([[score]])).covariance()
        assert sigma**2 * cov[0, 0] == pytest.approx(np.var(slopes), rel=0.06)
        assert sigma**2 / known < 0.8 * np.var(slopes), "the inverse alone states too little"

    def test_never_less_than_the_inverse_and_finite(self):
        """Oracle: V below I counts as I; a direction that is next to unknown stays finite."""
        small = Information(self.KNOWN, 0.5 * self.KNOWN).covariance()
        np.testing.assert_allclose(small, np.linalg.inv(self.KNOWN), rtol=1e-9)
        flat = np.diag([1.0, 1e-8])
        assert np.isfinite(Information(flat, np.eye(2)).covariance()).all()
        assert Information(flat, np.eye(2)).covariance()[1, 1] <= 1.01e10
