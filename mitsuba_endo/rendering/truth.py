"""The exact calibration of a synthetic scene, in the structure of a solution."""

from ..records.rig import Camera
from ..records.solution import Estimate, Frame, Outcome, PoseEstimate, ProjectorEstimate, Solution
from .scene import LoadedScene


def truth_of(loaded: LoadedScene, name: str = "map") -> Solution:
    """Return the scene's exact values as a one-frame :class:`Solution` (units mm).

    Args:
        loaded: the scene.
        name: name of the frame.
    """
    projector, (width, height) = loaded.projector(), loaded.pattern_size()
    world_from_camera = loaded.world_from_camera()
    projector_from_camera = loaded.world_from_projector().inverse() @ world_from_camera
    return Solution(
        outcome=Outcome.TRUTH,
        units="mm",
        scale="truth",
        camera=Camera.from_model(loaded.camera()),
        projector=ProjectorEstimate(
            law=projector.law,
            width=width,
            height=height,
            focal=_exact(projector.focal),
            centre=_exact(list(projector.centre)),
            aspect=_exact(projector.aspect),
            distortion=_exact(list(projector.distortion.coefficients)),
        ),
        frames=[
            Frame(
                name=name,
                projector_from_camera=PoseEstimate.of(projector_from_camera, status="fixed"),
                world_from_camera=PoseEstimate.of(world_from_camera, status="fixed"),
            )
        ],
    )


def _exact(value: float | list[float]) -> Estimate:
    return Estimate(value=value, status="fixed")
