"""The verdict: sentences for every state of an unknown."""

from typing import Any

from mitsuba_endo.records.solution import (
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
)
from mitsuba_endo.solve.reporting.verdict import verdict
from tests.solve.problems import POSE

MEASURED = PoseEstimate.of(POSE, std=[1e-3, 2e-3, 1e-3, 0.01, 0.02, 0.01])
FOCAL = Estimate(value=330.0, std=0.5, status="measured")


def frame(name: str, camera: PoseEstimate | None = None, pose: PoseEstimate = MEASURED) -> Frame:
    fixed = PoseEstimate.of(POSE, status="fixed")
    return Frame(name=name, projector_from_camera=pose, world_from_camera=camera or fixed)


def sentences(
    frames: list[Frame] | None = None, focal: Estimate = FOCAL, **changes: Any
) -> list[str]:
    centre = changes.pop("centre", Estimate(value=[250.0, 205.0], status="fixed"))
    fields = {"units": "mm", "scale": "baseline", **changes}
    return verdict(
        Solution(
            outcome=Outcome.CONVERGED, frames=frames or [frame("a")],
            projector=ProjectorEstimate(law="pinhole", focal=focal, centre=centre), **fields,
        )
    )  # fmt: skip


def test_of_a_measured_calibration():
    """Oracle: written out; 1.96 standard deviations, the largest of three, in degrees."""
    assert sentences() == [
        "Scale: lengths are in mm, from the baseline.",
        "Focal length: 330 ± 0.98 px (95 %).",
        "Projector pose: t = (-6, 1.3, 0.7) mm, each within ± 0.039 mm; rotation within "
        "± 0.22 degrees (95 %).",
    ]


def test_of_what_was_given():
    """Oracle: nothing given is called measured."""
    out = sentences([frame("a", pose=PoseEstimate.of(POSE, status="fixed"))],
                    Estimate(value=330.0, status="fixed"))  # fmt: skip
    assert out[1:] == [
        "Focal length: 330 px, given and not estimated.",
        "Projector pose: given and not estimated.",
    ]


def test_of_what_could_not_be_determined():
    """Oracle: no number of it appears, the reason does."""
    lost = Estimate(value=None, std=99.0, status="unobservable", reason="it is a plane")
    pose = PoseEstimate(R=None, t=None, status="unobservable", reason="too flat")
    out = sentences([frame("a", pose=pose)], lost)
    assert "Focal length: not determined; it is a plane." in out
    assert "Projector pose: not determined; too flat." in out
    assert not any("99" in line for line in out)


def test_of_what_is_weak():
    """Oracle: number, interval and reason."""
    weak = Estimate(value=[250.0, 205.0], std=[5.0, 2.0], status="weak", reason="fix it")
    assert (
        "Projector centre: 250 ± 9.8 px, 205 ± 3.9 px (95 %); only weakly determined, fix it."
        in sentences(centre=weak)
    )


def test_names_frames_only_where_there_are_several():
    """Oracle: the frames' names; a camera at the origin is not mentioned."""
    other = MEASURED.model_copy(update={"t": [-5.0, 1.0, 0.5]})
    out = sentences([frame("a"), frame("b", MEASURED, other)])
    assert any(line.startswith("Projector pose of a: t = (-6") for line in out)
    assert any(line.startswith("Projector pose of b: t = (-5") for line in out)
    assert any(line.startswith("Camera pose of b: ") for line in out)
    assert not any(line.startswith("Camera pose of a") for line in out)


def test_says_a_shared_pose_once():
    """Oracle: one sentence for two frames."""
    out = sentences([frame("a"), frame("b", MEASURED)])
    assert sum(line.startswith("Projector pose: ") for line in out) == 1
    assert not any(line.startswith("Projector pose of") for line in out)


def test_of_the_scale():
    """Oracle: its source and uncertainty, and baselines as unit where it is unknown."""
    free = sentences(units="baseline", scale="up_to_scale")
    assert free[0].startswith("Scale: unknown; lengths are multiples of the first baseline")
    assert "baselines" in free[-1]
    known = sentences(scale="known_distance", scale_std_percent=0.5)[0]
    assert known.startswith("Scale: lengths are in mm, from the known distance, known to 0.5 % ")


def test_many_poses_are_said_together():
    """Oracle: five frames: a sentence a device, with the largest deviation, and one for the
    reason that two frames share; nothing is said five times."""
    other = MEASURED.model_copy(update={"t": [-5.0, 1.0, 0.5]})
    wide = MEASURED.model_copy(update={"std": [0.01] * 3 + [0.5] * 3})
    frames = [frame("f0"), frame("f1", other, other), frame("f2", MEASURED, wide)]
    frames += [
        frame(
            f"f{k}",
            None,
            MEASURED.model_copy(update={"status": "weak", "reason": f"relief {k}.0 mm"}),
        )
        for k in (3, 4)
    ]
    out = sentences(frames)
    (poses,) = [line for line in out if line.startswith("Projector poses of 5 frames:")]
    assert "at most 0.98)" in poses
    assert "Projector poses of f3 and f4: only weakly determined; relief 3.0 mm." in out
    assert sum("poses of" in line for line in out) == 3


def test_warnings_of_frames_are_grouped():
    """Oracle: two matters, three frames; a single frame keeps its sentence."""
    from mitsuba_endo.solve.reporting.grouping import grouped

    left = [
        ("a.exr", "holds 12 correspondences"), ("b.exr", "its lens folds"),
        ("c.exr", "holds 9 correspondences"),
    ]  # fmt: skip
    assert grouped(
        left, "frame {names} was left out", "{count} frames were left out ({names})"
    ) == [
        "2 frames were left out (a.exr and c.exr): a.exr: holds 12 correspondences",
        "frame b.exr was left out: its lens folds",
    ]
