"""What the pages of the rig file, the commands and the glossary say, tried out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.rig import Camera, Rig
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.contradictions import check_surface
from mitsuba_endo.solve.costs.gaussian_prior import gaussian_prior
from mitsuba_endo.solve.frames.initial_poses import start_frame
from mitsuba_endo.solve.minimisers.minimise import minimiser_of
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.block import BLOCKS
from mitsuba_endo.solve.unknowns.layout import Layout, make_layout
from tests.rigs import with_noise
from tests.solve.problems import map_of, rig_file, small_rig

PAGE = (Path(__file__).parents[2] / "docs" / "rig.md").read_text("utf-8")
SMALLEST = yaml.safe_load(PAGE.split("```yaml\n")[1].split("```")[0])


def rig_with(**changes: Any) -> Rig:
    """The page's smallest file with more keys of its parts."""
    parts = {k: {**SMALLEST.get(k, {}), **v} for k, v in changes.items()}
    return Rig.model_validate({**SMALLEST, **parts})


def layout_with(**changes: Any) -> Layout:
    return make_layout(rig_with(**changes), 3)


def refused(**changes: Any) -> str:
    with pytest.raises(InputError) as caught:
        layout_with(**changes)
    return str(caught.value)


class TestShare:
    def test_defaults_are_the_tables(self) -> None:
        """Oracle: the table's rows."""
        layout = layout_with()
        rows = [line.split("|")[1:3] for line in PAGE.split("| Block | Default |")[1].splitlines()]
        said = {n.strip(): default for row in rows if len(row) == 2
                for names, default in [row] for n in names.replace("`", "").split(",")}  # fmt: skip
        assert set(BLOCKS) < set(said)
        for name in BLOCKS:
            assert said[name].strip().startswith(f"`{layout.sharing(name)}`"), name

    def test_fixed_keeps_the_rigs_value(self) -> None:
        """Oracle: a start of 310 stays; without a value the field is named."""
        start = {"focal": {"value": 310, "refine": True}}
        layout = layout_with(projector=start, share={"focal": "fixed"})
        assert not layout.free["focal"]
        assert np.exp(layout.given["focal"]) == pytest.approx(310)
        assert "projector.focal.value" in refused(share={"focal": "fixed"})
        assert "projector.pose" in refused(share={"projector_pose": "fixed"})

    def test_a_number_can_be_a_start(self) -> None:
        """Oracle: fixed alone, an unknown with ``shared``."""
        assert not layout_with(projector={"focal": 310}).free["focal"]
        assert layout_with(projector={"focal": 310}, share={"focal": "shared"}).free["focal"]

    @pytest.mark.parametrize("block", ["camera_focal", "camera_centre", "camera_distortion"])
    def test_a_camera_of_its_own_for_each_frame_is_refused(self, block: str) -> None:
        assert layout_with(share={block: "shared"}).sharing(block) == "shared"
        assert f"share.{block}" in refused(share={block: "per_frame"})


class TestCameraIntrinsics:
    STD = {"K_std": [1.0, 1.1, 0.5, 0.6], "distortion_std": 0.01}
    ALL = dict.fromkeys(["camera_focal", "camera_centre", "camera_distortion"], "shared")

    def test_deviations_are_a_prior_of_what_is_unknown(self) -> None:
        """Oracle: none where all is fixed or no deviation is given, else those of the rig."""
        for changes in ({"camera": self.STD}, {"share": self.ALL}):
            rig = rig_with(**changes)
            assert gaussian_prior(rig, make_layout(rig, 1)) is None
        rig = rig_with(camera=self.STD, share=self.ALL)
        prior = gaussian_prior(rig, make_layout(rig, 1))
        assert prior is not None
        focal = np.diag(np.array(rig.camera.K))[:2]
        np.testing.assert_allclose(prior.std["camera_focal"] * focal, [1.0, 1.1])
        np.testing.assert_allclose(prior.std["camera_centre"], [0.5, 0.6])
        np.testing.assert_allclose(prior.std["camera_distortion"], [0.01, 0.01])

    def test_two_coefficients_at_least_are_unknown(self) -> None:
        """Oracle: k1 and k2 from 0, or as many as the rig gives."""
        layout = layout_with(share=self.ALL)
        assert layout.names["camera_distortion"] == ("k1", "k2")
        assert list(layout.given["camera_distortion"]) == [0.0, 0.0]
        more = layout_with(camera={"distortion": [0.1, 0, 0, 0, 0.02]}, share=self.ALL)
        assert len(more.names["camera_distortion"]) == 5


class TestPose:
    """A pose in the rig instead of a search."""

    RIG = small_rig("direction_cosine")

    def start(self, scale: float = 1.0, focal: Any = None) -> Any:
        pose = self.RIG.projector_from_camera
        given = {"R": pose.R.tolist(), "t": (scale * pose.t).tolist()}
        projector = {
            "law": "direction_cosine", "width": self.RIG.size[0], "height": self.RIG.size[1],
            "centre": list(self.RIG.projector.centre), "aspect": self.RIG.projector.aspect,
            "pose": given, **({} if focal is None else {"focal": focal}),
        }  # fmt: skip
        rig = Rig(camera=Camera.from_model(self.RIG.camera), projector=projector)  # type: ignore[arg-type]
        layout, law = make_layout(rig, 1), "direction_cosine"
        return start_frame(map_of(self.RIG), self.RIG.camera, rig, layout, law, Options())

    def test_its_length_does_not_matter(self) -> None:
        """Oracle: the same start from a translation three times as long."""
        first, second = self.start(), self.start(3.0)
        np.testing.assert_allclose(first.projector_from_camera.t, second.projector_from_camera.t)
        assert np.linalg.norm(first.projector_from_camera.t) == pytest.approx(1)
        assert float(first.projector.focal) == pytest.approx(float(second.projector.focal))

    def test_without_a_focal_length_one_is_looked_for(self) -> None:
        """Oracle: the true one, 330, within a per cent; the pose stays."""
        start = self.start()
        assert float(start.projector.focal) == pytest.approx(330, rel=0.01)
        np.testing.assert_allclose(start.projector_from_camera.R, self.RIG.projector_from_camera.R)

    def test_with_one_nothing_is_searched(self) -> None:
        """Oracle: a start that is 10 % off comes back."""
        start = self.start(focal={"value": 363.0, "refine": True})
        assert float(start.projector.focal) == 363.0


def test_the_old_name_of_the_solver_is_understood() -> None:
    """Oracle: the same minimiser under both names, another one for adam."""
    new, old = (minimiser_of(Options(solver=n)) for n in ("levenberg-marquardt", "gauss-newton"))
    assert type(new) is type(old)
    assert type(minimiser_of(Options(solver="adam"))) is not type(new)
    assert type(minimiser_of(Options())) is type(new)


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("check_model", [False, True])
def test_deviations_without_effect_are_warned_of(check_model: bool) -> None:
    """Oracle: fields that are priors of fixed values alone, unless the model is checked."""
    rig = with_noise(small_rig("direction_cosine"), 0.1, 0)
    camera = {**Camera.from_model(rig.camera).model_dump(), **TestCameraIntrinsics.STD}
    record = rig_file(rig, camera=camera, share={"camera_centre": "shared"})
    options = Options(jackknife=False, check_model=check_model)
    told = calibrate([map_of(rig)], record, options).solution.warnings
    assert any(w.startswith("camera.distortion_std: has no effect") for w in told) != check_model
    assert not any("K_std" in w for w in told), "the centre's are used"


@pytest.mark.parametrize(
    ("record", "frames", "options"),
    [
        ({}, 1, {}),
        ({"share": {"surface": "per_frame"}}, 2, {}),
        ({}, 2, {"cameras": "identity"}),
    ],
)
def test_a_mesh_is_for_frames_that_share_a_surface(
    record: dict[str, Any], frames: int, options: dict[str, Any]
) -> None:
    """Oracle: an InputError about the surface or the cameras, none with a lattice."""
    rig = rig_with(**record)
    check_surface(Options(**options), rig, frames, None)
    with pytest.raises(InputError, match="mesh"):
        check_surface(Options(surface="mesh", **options), rig, frames, None)
    check_surface(Options(surface="mesh"), rig_with(), 2, None)
