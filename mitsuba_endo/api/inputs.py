"""What callers bring, paths, arrays or records, as maps and a rig."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..decoding.frame_files import frame_files
from ..decoding.image_files import ImageFrame, full_scale, is_images, read_frames
from ..decoding.stack_map import KINDS, stack_map
from ..errors import InputError, NothingDecodedError, shown
from ..records.correspondence import CorrespondenceMap, load_maps
from ..records.map_convention import MapConvention, read_map_convention
from ..records.rig import Rig, load_rig
from ..records.validation import validate
from ..refine.image_decoder import ImageDecoder

Array: TypeAlias = NDArray[Any]
FrameInput: TypeAlias = str | Path | Array | CorrespondenceMap
"""A frame: a file of a map or an image, a folder or video of images, a map (H, W, 2), or a map's
record."""
RigInput: TypeAlias = str | Path | Mapping[str, Any] | Rig
"""A rig: its file, its contents as they would stand in the file, or its record."""

OnImage: TypeAlias = Callable[[str, NDArray[np.float32]], None]
"""Called with a frame's name and its image (H, W, C), BGR or grey, 1 = full scale."""


def as_rig(rig: RigInput) -> Rig:
    """Return a rig's record.

    Raises:
        InputError: a file or contents that cannot be used, or something else.
    """
    if isinstance(rig, Rig):
        return rig
    if isinstance(rig, str | Path):
        return load_rig(rig)
    if isinstance(rig, Mapping):
        return validate(Rig, dict(rig), "rig")
    raise InputError(f"is {shown(type(rig).__name__)} and no rig", "rig", "give rig.yaml's path")


def as_frames(captures: FrameInput | Iterable[FrameInput]) -> list[FrameInput]:
    """Return the frames of a capture or of several."""
    if isinstance(captures, str | Path | CorrespondenceMap | np.ndarray):
        return [captures]
    if not isinstance(captures, Iterable):
        what = f"is {shown(type(captures).__name__)} and no capture"
        raise InputError(what, "captures", "give paths, arrays or maps")
    return list(captures)


def as_correspondences(
    captures: Iterable[FrameInput],
    rig: Rig,
    pattern: str | None,
    refine: bool,
    map_convention: str = "",
    on_image: OnImage | None = None,
) -> list[CorrespondenceMap]:
    """Return the maps of frames; images are decoded.

    Args:
        captures: of every frame.
        rig: sizes of image and pattern.
        pattern: in the images, a command's ``--pattern``; None: the coded grid. With ``stack`` each
            folder is a stack, and makes one frame.
        refine: whether decoded coordinates are refined on their images.
        map_convention: of files and arrays, a command's ``--map-convention``; records are right.
        on_image: called with the name and pixels of every image that was decoded.

    Raises:
        InputError: a frame that cannot be read or is of another kind, a pattern where there
            are no images, or a convention of maps where there are no maps.
        NothingDecodedError: no pattern in any image.
    """
    frames = [frame for k, capture in enumerate(captures) for frame in _frames(capture, k)]
    paths = [frame for frame in frames if isinstance(frame, Path)]
    images = [path for path in paths if is_images(path)]
    size = rig.projector.width, rig.projector.height
    if images and len(images) < len(frames):
        raise InputError("maps and images are given", str(images[0]), "give one kind")
    if images:
        if map_convention:
            raise InputError("is for maps, and images are given", "map_convention", "leave it out")
        if pattern in KINDS:
            return [stack_map(path, size, pattern).map for path in paths]
        return _decoded(images, rig, pattern, refine, on_image)
    if pattern is not None:
        raise InputError("is for images, and maps are given", "pattern", "leave it out")
    convention = read_map_convention(map_convention)
    read = iter(load_maps(paths, convention, size))
    return [
        frame if isinstance(frame, CorrespondenceMap)
        else _map_of(frame, k, convention, size) if isinstance(frame, np.ndarray)
        else next(read)
        for k, frame in enumerate(frames)
    ]  # fmt: skip


def photographs_in(captures: Iterable[FrameInput], pattern: str | None) -> list[Path]:
    """Return the images of the coded grid among the frames of captures."""
    if pattern in KINDS:
        return []
    frames = (frame for k, capture in enumerate(captures) for frame in _frames(capture, k))
    return [frame for frame in frames if isinstance(frame, Path) and is_images(frame)]


def _frames(capture: FrameInput, index: int) -> list[Path | Array | CorrespondenceMap]:
    """Return the frames of a capture: of a folder of maps, each."""
    if isinstance(capture, CorrespondenceMap | np.ndarray):
        return [capture]
    if isinstance(capture, str | Path):
        return list(frame_files([Path(capture)]))
    what = f"is {shown(type(capture).__name__)} and no capture"
    raise InputError(what, f"captures[{index}]", "give a path, an array (H, W, 2) or a map")


def decode_frame(decoder: ImageDecoder, frame: ImageFrame) -> CorrespondenceMap:
    """Return the map of an image of the coded grid.

    Raises:
        InputError: an image of another size than the rig's.
        NothingDecodedError: the image does not show the pattern.
    """
    decoded = decoder.decode(frame)
    if decoded.grid.reason:
        todo = "check the pattern, light and focus"
        raise NothingDecodedError(decoded.grid.reason, frame.name, todo)
    return decoded.map.map


def as_image(image: str | Path | Array) -> ImageFrame:
    """Return an image that is a file or an array (H, W) or (H, W, 3) of integers or of 0 to 1.

    Raises:
        InputError: a file that cannot be read or holds several images, or another array.
    """
    if isinstance(image, str | Path):
        frames = read_frames([Path(image)])
        first = next(frames)
        if next(frames, None) is not None:
            raise InputError("holds several images", str(image), "decode them one by one")
        tell(first)
        return first
    array = np.asarray(image)
    whole = array.dtype in (np.uint8, np.uint16)
    if array.ndim not in (2, 3) or not array.size or not (whole or array.dtype.kind == "f"):
        what = f"is an array {array.shape} of {array.dtype}"
        raise InputError(what, "image", "give (H, W) or (H, W, 3), 8 or 16 bits or 0 to 1")
    scale = full_scale(array) if whole else 1.0
    scaled = np.divide(array, scale, dtype=np.float32)
    return ImageFrame("image", "image", scaled if scaled.ndim == 3 else scaled[..., None])


def tell(frame: ImageFrame) -> None:
    """Warn of what was done to an image, once for each file."""
    if frame.note:
        warnings.warn(frame.note, UserWarning, stacklevel=4)


def _decoded(
    images: list[Path], rig: Rig, pattern: str | None, refine: bool, on_image: OnImage | None
) -> list[CorrespondenceMap]:
    """Return the maps of the images that show the pattern.

    Raises:
        NothingDecodedError: none does; says why for the first.
    """
    maps: list[CorrespondenceMap] = []
    failure: NothingDecodedError | None = None
    decoder = ImageDecoder(rig, pattern, refine=refine)
    for frame in read_frames(images):
        tell(frame)
        try:
            maps.append(decode_frame(decoder, frame))
            if on_image is not None:
                on_image(maps[-1].name, frame.image)
        except NothingDecodedError as error:
            failure = failure or error
    if not maps and failure is not None:
        raise failure
    return maps


def _map_of(
    array: Array, index: int, convention: MapConvention, size: tuple[int, int]
) -> CorrespondenceMap:
    if array.ndim != 3 or array.shape[2] != 2 or array.dtype.kind not in "uif":
        what = f"is an array {array.shape} of {array.dtype}"
        raise InputError(what, f"captures[{index}]", "give a map (H, W, 2) in pattern pixels")
    q = convention.coordinates(np.ascontiguousarray(array, np.float32), size)
    return CorrespondenceMap(q, f"frame_{index}")
