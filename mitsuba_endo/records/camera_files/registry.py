"""Formats of camera files, tried in turn on the content."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from .camera_file import CameraFile
from .document import Document, read_document

Matches = Callable[[Document], bool]
Read = Callable[[Document], CameraFile]


@dataclass(frozen=True)
class Format:
    """One program's way of writing a camera."""

    name: str
    matches: Matches
    """Tells, from the content alone, whether a file is of this format."""
    read: Read
    last: bool
    """Whether it is tried after all others: it takes any file with a camera matrix."""


FORMATS: dict[str, Format] = {}
"""Every format, by the name that is told to the user."""


def register_format(name: str, matches: Matches, last: bool = False) -> Callable[[Read], Read]:
    """Decorator that makes a reader available."""

    def register(read: Read) -> Read:
        FORMATS[name] = Format(name, matches, read, last)
        return read

    return register


def read_camera_file(path: str | Path) -> tuple[CameraFile, str]:
    """Read a camera from a file of any format; ``FILE#NAME`` is the camera NAME of several.

    Returns:
        The camera, and a sentence that says what was read.

    Raises:
        InputError: no such file, no format that is known, a camera model or coefficient that this
            package does not have, or a key that may be part of the camera and is not known.
    """
    file, part = _split(Path(path))
    document = read_document(file, part)
    for form in sorted(FORMATS.values(), key=lambda form: form.last):
        if form.matches(document):
            camera = form.read(document)
            return camera, f"{file.name} is read as {form.name}: {camera.describe()}."
    raise InputError(
        "is not an OpenCV FileStorage or another camera file that is known", str(file),
        f"give one of {', '.join(FORMATS)}",
    )  # fmt: skip


def _split(path: Path) -> tuple[Path, str]:
    if path.exists() or "#" not in path.name:
        return path, ""
    name, part = path.name.rsplit("#", 1)
    return path.with_name(name), part


def chosen(names: list[str], document: Document) -> str:
    """Return the one camera of a file, or the one that is asked for.

    Raises:
        InputError: there are several and none is asked for, or it is not there.
    """
    if document.part in names:
        return document.part
    if document.part or len(names) != 1:
        absent = f", no {document.part}" if document.part else ""
        raise InputError(
            f"holds the cameras {', '.join(names)}{absent}", document.where,
            f"write which one, e.g. {document.path.name}#{names[0]}",
        )  # fmt: skip
    return names[0]
