"""Camera files that a rig file names instead of its own keys."""

from pathlib import Path
from typing import Any

from ...errors import InputError
from .camera_file import Values
from .registry import read_camera_file

BESIDE = ("width", "height", "K_std", "distortion_std")
"""Keys of the rig file's camera that may stand beside ``file``: formats do not all hold them."""


def named_file(value: Any) -> Values | None:
    """Return the keys beside ``file``, and it, if a part of the rig names a file."""
    if isinstance(value, str):
        return {"file": value}
    return value if isinstance(value, dict) and isinstance(value.get("file"), str) else None


def camera_values(
    path: Path, given: Values, notes: list[str], with_projector: bool
) -> tuple[Values, str]:
    """Return the keys of a camera and the file they are from.

    The rig may add the image's size and deviations, which not every format holds.
    ``with_projector`` tells that it names a file for its projector.

    Raises:
        InputError: the file cannot be read, or contradicts the rig.
    """
    source = path.parent / given["file"]
    file, note = read_camera_file(source)
    notes.append(note)
    if file.projector and not with_projector:
        takes = f"projector: {{file: {given['file']}}}"
        notes.append(f"{source.name} holds a projector too, which {takes} takes.")
    for key, value in given.items():
        if key not in ("file", *BESIDE):
            raise InputError("unknown key beside file", f"{path}: camera.{key}", "remove it")
        if key != "file" and file.camera.get(key, value) != value:
            raise InputError(
                f"is {value}, and {file.camera[key]} in {source.name}", f"{path}: camera.{key}",
                "give the camera of these images",
            )  # fmt: skip
    values = file.camera | {key: given[key] for key in BESIDE if key in given}
    if "width" not in values or "height" not in values:
        raise InputError(
            "image_width or image_height is missing", str(source),
            f"add them, or write camera: {{file: {given['file']}, width: W, height: H}}",
        )  # fmt: skip
    return values, str(source)


def projector_values(path: Path, given: Values, notes: list[str]) -> Values:
    """Return the keys of a projector; what the rig says beside its file counts more.

    Raises:
        InputError: the file cannot be read, or holds no projector.
    """
    source = path.parent / given["file"]
    file, _ = read_camera_file(source)
    if not file.projector:
        raise InputError("holds no projector", str(source), "write its keys into the rig file")
    values = file.projector | {key: value for key, value in given.items() if key != "file"}
    focal = file.projector["focal"]["value"]
    start = (
        "focal length and pose are starts" if "pose" in values else "the focal length is a start"
    )
    notes.append(f"{source.name} gives the projector, focal length {focal:g}; its {start}.")
    return values
