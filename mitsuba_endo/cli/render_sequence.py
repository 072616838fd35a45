"""``mitsuba-endo render --trajectory``: a scene seen along a way, frame by frame."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from .console import Session

if TYPE_CHECKING:
    from ..geometry.transforms import RigidTransform
    from ..rendering.moving_capture import MovingCapture

FRAMES = 40
"""Of a sequence, if no number is given."""


@dataclass(frozen=True)
class SequenceRequest:
    """The options of a sequence."""

    trajectory: str | None = None
    projector_trajectory: Path | None = None
    frames: int = FRAMES
    noise: float = 0.0
    nothing: str | None = None
    photographs: bool = False

    def check(self) -> bool:
        """Tell whether a sequence is asked for.

        Raises:
            InputError: an option of a sequence without one, or two that exclude each other.
        """
        from ..errors import InputError

        if self.trajectory is not None:
            if self.photographs and self.noise:
                raise InputError("is of maps, not of photographs", "--noise", "leave it out")
            return True
        for field in fields(self):
            if getattr(self, field.name) != field.default:
                name = f"--{field.name.replace('_', '-')}"
                raise InputError("is of a sequence", name, "give --trajectory too")
        return False

    def dark(self) -> range:
        """Return the frames that show nothing.

        Raises:
            InputError: not of the form A:B.
        """
        from ..errors import InputError

        if self.nothing is None:
            return range(0)
        first, _, end = self.nothing.partition(":")
        if not (first.isdecimal() and end.isdecimal() and int(first) < int(end)):
            raise InputError(f"'{self.nothing}' is not A:B", "--nothing", "e.g. --nothing 25:35")
        return range(int(first), int(end))


def render_sequence(
    scene: str,
    out: Path,
    settings: dict[str, str],
    request: SequenceRequest,
    spp: int,
    seed: int,
    output: Session,
) -> None:
    """Render a sequence and write its folder."""
    from ..folder_mark import Kind
    from ..outputs import prepare_folder
    from ..show.recording_folder import write_recording_folder

    files = [path for path in (request.trajectory, request.projector_trajectory) if path]
    prepare_folder(out, Kind.RECORDING, [scene, *settings.values(), *files])
    with output.progress("Starting Mitsuba") as advance:
        capture = moving_capture(scene, settings, request, seed)
        write_recording_folder(out, capture, spp if request.photographs else None, advance)
    what = "photographs" if request.photographs else "maps"
    folder = "images" if request.photographs else "maps"
    output.print(
        f"{out}: {len(capture)} {what}. Track them: mitsuba-endo sequence {out}/{folder} "
        f"--rig {out}/rig.yaml --out result"
    )
    output.summary({"folder": str(out), "frames": len(capture), "kind": what})


def moving_capture(
    scene: str, settings: dict[str, str], request: SequenceRequest, seed: int
) -> "MovingCapture":
    """Load a scene and read or make the way through it.

    Raises:
        InputError: an unknown scene or trajectory, or a file that cannot be used.
    """
    import numpy as np

    from ..geometry.trajectories import TRAJECTORIES, creeping
    from ..rendering.moving_capture import MovingCapture
    from ..rendering.scene import load_scene

    dark = request.dark()
    assert request.trajectory is not None
    rng = np.random.default_rng([seed, 1])
    if request.trajectory in TRAJECTORIES:
        cameras = TRAJECTORIES[request.trajectory](request.frames, rng)
    else:
        cameras = _read(Path(request.trajectory), request.frames)
    projectors = creeping(len(cameras), rng)
    if request.projector_trajectory is not None:
        lights = _read(request.projector_trajectory, len(cameras))
        poses = [light.inverse() @ camera for light, camera in zip(lights, cameras, strict=True)]
        projectors = [pose @ poses[0].inverse() for pose in poses]
    first = cameras[0].inverse()
    moved = [first @ camera for camera in cameras]
    loaded = load_scene(scene, **settings)
    return MovingCapture(loaded, moved, projectors, request.noise, dark, seed)


def _read(path: Path, count: int) -> list["RigidTransform"]:
    """Return the poses of a TUM file.

    Raises:
        InputError: neither a file nor a known name, or fewer poses than frames.
    """
    from ..errors import InputError
    from ..geometry.trajectories import TRAJECTORIES
    from ..reading.regular import is_file
    from ..records.trajectory import load_tum

    if not is_file(path):
        names = ", ".join(TRAJECTORIES)
        raise InputError("no such file or trajectory", str(path), f"give a TUM file, or {names}")
    poses = [pose for _, pose in load_tum(path)]
    if len(poses) < count:
        raise InputError(f"holds {len(poses)} poses", str(path), f"give --frames {len(poses)}")
    return poses[:count]
