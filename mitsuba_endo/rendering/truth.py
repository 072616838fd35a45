"""The exact calibration of a synthetic scene."""

from ..geometry.endoscope import Endoscope
from ..records.ground_truth import GroundTruth, TrueFrame
from .scene import LoadedScene


def truth_of(loaded: LoadedScene, name: str = "map") -> GroundTruth:
    """Return the scene's exact values, of one frame.

    Args:
        loaded: the scene.
        name: name of the frame.
    """
    world_from_camera = loaded.world_from_camera()
    projector_from_camera = loaded.world_from_projector().inverse() @ world_from_camera
    endoscope = Endoscope(
        loaded.camera(), world_from_camera, loaded.projector(), projector_from_camera
    )
    return GroundTruth([TrueFrame(name, endoscope)], loaded.pattern_size())
