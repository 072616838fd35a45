"""Values that a format cannot do without; what was not determined is named."""

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel
from ...geometry.transforms import RigidTransform
from ...records.solution import Frame, PoseEstimate, Solution

_TODO = "capture what the verdict asks for and calibrate again"


def required_camera(solution: Solution) -> CameraModel:
    """Return the camera.

    Raises:
        InputError: the solution does not hold it.
    """
    if solution.camera is None:
        raise InputError("camera is missing", "solution.json", "calibrate again")
    return solution.camera.to_model()


def camera_in(camera: CameraModel, names: dict[str, str], program: str) -> str:
    """Return what another program calls the camera's model.

    Raises:
        InputError: it has no such model.
    """
    if camera.model not in names:
        raise InputError(
            f"{program} has no camera like the model {camera.model}", "camera.model",
            f"choose a format that has; {program} has {', '.join(names)}",
        )  # fmt: skip
    return names[camera.model]


def pinhole_only(solution: Solution, program: str) -> None:
    """Refuse a projector that is no pinhole, for programs whose cameras all are.

    Raises:
        InputError: names the law.
    """
    if solution.projector.law != "pinhole":
        raise InputError(
            f"{program} has no camera like the law {solution.projector.law}", "projector.law",
            "use --format opencv",
        )  # fmt: skip


def metres(solution: Solution, pose: RigidTransform) -> list[float]:
    """Return a translation in metres; in baselines, as it is, if the solution is up to scale."""
    return (pose.t * (1e-3 if solution.units == "mm" else 1.0)).tolist()


def required_projector(solution: Solution, frame: Frame) -> ProjectorModel:
    """Return the projector's intrinsics in a frame, which may have a focal length of its own.

    Raises:
        InputError: names the value that was not determined.
    """
    projector = solution.projector
    if frame.focal is not None:
        projector = projector.model_copy(update={"focal": frame.focal})
    for name in ("focal", "centre", "aspect", "distortion"):
        estimate = getattr(projector, name)
        if estimate.value is None:
            where = "frames" if name == "focal" and frame.focal is not None else "projector"
            raise _unknown(f"{where}.{name}", estimate.reason)
    model = projector.to_model()
    assert model is not None  # every value was looked at above
    return model


def required_size(solution: Solution) -> tuple[int, int]:
    """Return width and height of the pattern, pattern pixels.

    Raises:
        InputError: the solution does not hold them.
    """
    width, height = solution.projector.width, solution.projector.height
    if width is None or height is None:
        raise _unknown("projector.width or projector.height", None)
    return width, height


def projector_pose(frame: Frame) -> RigidTransform:
    """Return projector_from_camera of a frame.

    Raises:
        InputError: it was not determined.
    """
    return _pose(frame.projector_from_camera, f"projector_from_camera of frame {frame.name}")


def camera_pose(frame: Frame) -> RigidTransform:
    """Return world_from_camera of a frame.

    Raises:
        InputError: it was not determined.
    """
    return _pose(frame.world_from_camera, f"world_from_camera of frame {frame.name}")


def _pose(estimate: PoseEstimate, name: str) -> RigidTransform:
    pose = estimate.to_transform()
    if pose is None:
        raise _unknown(name, estimate.reason)
    return pose


def _unknown(name: str, reason: str | None) -> InputError:
    why = f" ({reason.rstrip('.')})" if reason else ""
    return InputError(f"{name} was not determined{why}", "solution.json", _TODO)
