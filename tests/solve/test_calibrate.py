"""Calibration end to end, from a map and a rig file to the solution."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.brown_distortion import BrownDistortion
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_angle
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.solution import load_solution, save_solution
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.rigs import Rig, bumpy_sheet, cast, lopsided_fisheye, sphere, with_noise
from tests.solve.problems import NOISE, POSE, PROJECTION_MODELS, map_of, rig_file, small_rig


def run(rig: Rig, options: Options | None = None, **changes: Any) -> Calibration:
    return calibrate([map_of(rig)], rig_file(rig, **changes), options)


def check(found: Calibration, rig: Rig, deviations: float = 5) -> None:
    """Compare with the truth in units of the stated standard deviations, capped by physical limits:
    neither a large error nor a large stated deviation passes."""
    solution = found.solution
    assert solution.outcome == "converged"
    focal = solution.projector.focal
    if focal.status != "fixed":
        assert focal.status == "measured"
        error = abs(focal.value - rig.projector.focal)
        assert error < min(deviations * focal.std, 3e-3 * rig.projector.focal)
    pose = solution.frames[0].projector_from_camera
    transform = pose.to_transform()
    assert transform is not None
    exact = rig.projector_from_camera
    if pose.status != "fixed":
        angle = rotation_angle(transform.R @ exact.R.T)
        assert angle < min(deviations * np.linalg.norm(pose.std[:3]), 1e-3)
        gap = np.linalg.norm(transform.t - exact.t)
        assert gap < min(deviations * np.linalg.norm(pose.std[3:]), 0.02 * rig.baseline)
    height, width = rig.depth.shape
    pixels = rig.camera.project(found.surface.vertices)
    x, y = np.round(pixels).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    truth = np.full(len(x), np.nan)
    truth[inside] = rig.depth[y[inside], x[inside]]
    relative = np.linalg.norm(found.surface.vertices, axis=1) / truth - 1
    assert np.nanmedian(np.abs(relative)) < 0.01


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", PROJECTION_MODELS)
class TestOneFrame:
    """Oracle: the truth of a ray-cast rig, within five stated standard deviations and 0.3 % of the
    focal length, a milliradian and 2 % of the baseline."""

    def test_distorted_projector_with_oblong_pixels(self, law: str):
        rig = small_rig(law, aspect=1.2, distortion=BrownDistortion((0.08, -0.05, 0.003, -0.002)))
        check(run(with_noise(rig, NOISE, 1)), rig)

    def test_fisheye_camera_in_a_sphere(self, law: str):
        camera = lopsided_fisheye(120, 88)
        model = small_rig(law).projector.with_(focal=260.0)
        rig = cast(camera, model, (512, 400), POSE, sphere((5, -3, 15), 50))
        check(run(with_noise(rig, NOISE, 2)), rig)

    def test_camera_with_oblong_pixels(self, law: str):
        K = np.array([[120.0, 0, 50], [0, 70, 38], [0, 0, 1]])
        camera = CameraModel("opencv", 110, 70, K, (0.05, -0.02, 0.002, 0.001))
        base = small_rig(law)
        surface = bumpy_sheet(65, (-0.1, 0.2), 6, 9)
        rig = cast(camera, base.projector, base.size, POSE, surface)
        check(run(with_noise(rig, NOISE, 3)), rig)

    def test_given_focal_length(self, law: str):
        rig = with_noise(small_rig(law), NOISE, 4)
        found = run(rig, projector={"focal": 330.0})
        check(found, rig)
        assert found.solution.projector.focal.status == "fixed"
        assert found.solution.projector.focal.value == pytest.approx(330, rel=1e-12)

    def test_given_pose(self, law: str):
        rig = with_noise(small_rig(law), NOISE, 5)
        given = {"R": POSE.R.tolist(), "t": POSE.t.tolist()}
        projector = {"pose": given, "focal": {"value": 330.0, "refine": True}}
        found = run(rig, projector=projector, share={"projector_pose": "fixed"})
        check(found, rig)
        pose = found.solution.frames[0].projector_from_camera
        assert pose.status == "fixed"
        np.testing.assert_allclose(pose.R, POSE.R, atol=1e-9)
        np.testing.assert_allclose(pose.t, POSE.t, rtol=1e-9)

    def test_everything_free_that_can_be(self, law: str):
        """Oracle: as above; aspect ratio and distortion are unknowns too, to 0.01."""
        rig = small_rig(law, distortion=BrownDistortion((0.05, 0.0)))
        noisy = with_noise(rig, 0.1, 6)
        share = {"aspect": "shared", "distortion": "shared"}
        known = {"distortion": [], "aspect": 1.0}
        solution = run(noisy, projector=known, share=share).solution
        for estimate, truth in (
            (solution.projector.aspect, [1.01]), (solution.projector.distortion, [0.05, 0.0]),
        ):  # fmt: skip
            assert estimate.value is not None
            gap = np.atleast_1d(estimate.value) - truth
            assert (np.abs(gap) < np.minimum(5 * np.atleast_1d(estimate.std), 0.01)).all()


@pytest.mark.usefixtures("llvm")
class TestUnits:
    """Oracle: the same optimum in other units."""

    RIG = with_noise(small_rig("direction_cosine"), NOISE, 7)

    def test_up_to_scale(self):
        mm, free = run(self.RIG), run(self.RIG, scale={})
        assert (free.solution.units, free.solution.scale) == ("baseline", "up_to_scale")
        pose = free.solution.frames[0].projector_from_camera
        assert np.linalg.norm(pose.t) == pytest.approx(1)
        ratio = mm.surface.vertices / free.surface.vertices
        np.testing.assert_allclose(ratio, self.RIG.baseline, rtol=1e-9)
        np.testing.assert_allclose(mm.surface.std, self.RIG.baseline * free.surface.std, rtol=1e-9)

    def test_uncertain_baseline(self):
        sure = run(self.RIG).solution.frames[0].projector_from_camera
        scale = {"baseline": self.RIG.baseline, "baseline_std": 0.1 * self.RIG.baseline}
        solution = run(self.RIG, scale=scale).solution
        unsure = solution.frames[0].projector_from_camera
        assert solution.scale_std_percent == pytest.approx(10)
        expected = np.hypot(sure.std[3:], 0.1 * np.abs(sure.t))
        np.testing.assert_allclose(unsure.std[3:], expected, rtol=1e-9)
        np.testing.assert_allclose(unsure.std[:3], sure.std[:3])

    def test_known_distance(self):
        ends = [[30, 20], [70, 60]]
        rays = self.RIG.camera.rays(np.array(ends, float))
        points = [r * self.RIG.depth[y, x] for r, (x, y) in zip(rays, ends, strict=True)]
        known = {"pixels": ends, "mm": float(np.linalg.norm(points[0] - points[1]))}
        solution = run(self.RIG, scale={"known_distance": known}).solution
        t = solution.frames[0].projector_from_camera.t
        assert np.linalg.norm(t) == pytest.approx(self.RIG.baseline, rel=0.01)


@pytest.mark.usefixtures("llvm")
class TestSolution:
    RIG = with_noise(small_rig("pinhole"), NOISE, 8)

    def test_is_complete_and_can_be_saved(self, tmp_path):
        """Oracle: the file read back; residuals at the level of the noise put in."""
        found = run(self.RIG)
        solution = found.solution
        save_solution(tmp_path / "solution.json", solution)
        assert load_solution(tmp_path / "solution.json") == solution
        frame = solution.frames[0]
        assert solution.noise_px == pytest.approx(NOISE, rel=0.04)
        assert frame.used == pytest.approx(np.isfinite(self.RIG.q[..., 0]).sum(), rel=0.01)
        assert 0 <= frame.outliers < 0.02
        assert solution.verdict
        assert not solution.warnings
        assert {"start", "optimise", "uncertainty"} <= set(solution.timings)
        assert found.frames[0].rendered.shape == self.RIG.q.shape
        inner = found.frames[0].used & np.isfinite(found.frames[0].rendered[..., 0])
        residual = found.frames[0].residual[inner]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(NOISE, rel=0.1)
        assert len(found.trace) > 1
        std = found.surface.std
        assert std is not None
        assert len(std) == len(found.surface.vertices)
        assert (std > 0).all()

    def test_std_is_the_larger_one(self):
        """Oracle: the maximum of the two that are given; none where it is switched off."""
        focal = run(self.RIG).solution.projector.focal
        assert focal.std == pytest.approx(max(focal.std_formal, focal.std_jackknife))
        without = run(self.RIG, Options(jackknife=False)).solution.projector.focal
        assert without.std_jackknife is None
        assert without.std == without.std_formal

    def test_doubts_about_the_input_are_told(self):
        """Oracle: rows of zeros are named and left out: the same solution as with NaN there."""
        zero, missing = self.RIG.q.copy(), self.RIG.q.copy()
        zero[:8], missing[:8] = 0.0, np.nan
        told = run(replace(self.RIG, q=zero)).solution
        plain = run(replace(self.RIG, q=missing)).solution
        assert ["hold (0, 0)" in w for w in told.warnings] == [True]
        assert told.projector == plain.projector

    def test_doubts_explain_why_there_is_no_solution(self):
        """Oracle: random coordinates and a camera of twice the image's size; both are said."""
        q = np.random.default_rng(0).uniform(0, 300, self.RIG.q.shape)
        rig = rig_file(self.RIG)
        K = [[2 * v for v in row] for row in rig.camera.K[:2]] + [[0, 0, 1]]
        camera = rig.camera.model_copy(update={"K": K})
        with pytest.raises(InputError, match=r"likely cause: camera\.K: by its centre"):
            calibrate([map_of(replace(self.RIG, q=q))], rig.model_copy(update={"camera": camera}))

    def test_says_when_it_did_not_converge(self):
        """Oracle: a warning and the outcome."""
        found = run(self.RIG, Options(max_iterations=1)).solution
        assert found.outcome == "max_iterations"
        assert any("not converged" in w for w in found.warnings)

    def test_reports_its_progress(self):
        """Oracle: shares of the work never fall, and end near one."""
        shares = []
        calibrate([map_of(self.RIG)], rig_file(self.RIG), progress=lambda s, _: shares.append(s))
        assert shares == sorted(shares)
        assert 0.8 < shares[-1] <= 1

    def test_plane_start(self):
        """Oracle: the truth, from a plane and the useless focal length of one pattern width."""
        options = Options(start="plane", plane_distance=11.0)
        check(run(self.RIG, options, projector={"focal": {"value": 300.0}}), self.RIG)

    def test_several_scenes_by_one_rig(self):
        """Oracle: the truth; three scenes know the shared focal length better than one."""
        surfaces = [bumpy_sheet(60 + 8 * k, (0.1 * k, -0.1), 5, 20 + k) for k in range(3)]
        rigs = [with_noise(small_rig("pinhole", s), NOISE, k) for k, s in enumerate(surfaces)]
        share = {"surface": "per_frame", "projector_pose": "shared", "camera_pose": "fixed"}
        maps = [map_of(r, f"{k}.npz") for k, r in enumerate(rigs)]
        found = calibrate(maps, rig_file(rigs[0], share=share)).solution
        alone = run(rigs[0]).solution
        assert [f.name for f in found.frames] == ["0.npz", "1.npz", "2.npz"]
        focal = found.projector.focal
        assert abs(focal.value - 330) < min(5 * focal.std, 1e-3 * 330)
        assert focal.std_formal < 0.8 * alone.projector.focal.std_formal
        poses = [f.projector_from_camera.to_transform() for f in found.frames]
        assert all(isinstance(p, RigidTransform) for p in poses)
        np.testing.assert_array_equal(poses[0].matrix(), poses[2].matrix())


def test_frame_focal_lengths_stand_with_the_frames(llvm: str):
    """Oracle: two projectors of which one has a longer focal length."""
    one = with_noise(small_rig("pinhole"), NOISE, 0)
    surface = bumpy_sheet(66, (-0.1, 0.2), 6, 5)
    two = with_noise(small_rig("pinhole", surface, focal=350.0), NOISE, 1)
    share = {"surface": "per_frame", "focal": "per_frame"}
    maps = [map_of(one, "one"), map_of(two, "two")]
    found = calibrate(maps, rig_file(one, share=share)).solution
    assert found.projector.focal.value is None
    for frame, truth in zip(found.frames, (330, 350), strict=True):
        assert frame.focal is not None
        assert abs(frame.focal.value - truth) < min(5 * frame.focal.std, 2e-3 * truth)
