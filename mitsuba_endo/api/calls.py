"""The steps, each one call, from what callers have to what they want."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..decoding.masks import Masks
from ..records.checkpoint import load_checkpoint
from ..records.correspondence import CorrespondenceMap
from ..records.rig import load_rig
from ..records.sharing_plan import with_plan
from ..refine.image_decoder import ImageDecoder
from ..rendering.render import Capture, render_capture
from ..rendering.scene import load_scene
from ..show.photographs import KeptPhotographs
from ..show.read_folder import read_solution_folder
from ..solve.calibrate import calibrate as solve
from ..solve.options import Options
from .inputs import (
    Array,
    FrameInput,
    RigInput,
    as_correspondences,
    as_frames,
    as_image,
    as_rig,
    decode_frame,
    photographs_in,
)
from .photographs import calibrated_again
from .result import Result


def calibrate(
    captures: FrameInput | Iterable[FrameInput],
    rig: RigInput,
    *,
    share: Mapping[str, str] | None = None,
    map_convention: str = "",
    mask: str | Path | None = None,
    pattern: str | None = None,
    refine: bool = True,
    second_round: bool = True,
    resume: str | Path | None = None,
    progress: Callable[[float, str], None] | None = None,
    options: Options | None = None,
) -> Result:
    """Calibrate a projector from what a camera saw.

    Args:
        captures: one frame or several: files of correspondence maps or of images of the coded
            grid, folders of either, videos, arrays (H, W, 2) of pattern pixels with NaN =
            missing, or maps' records.
        rig: what is known: a rig file's path, its contents, or its record.
        share: entries of the sharing plan to replace, e.g. ``{"projector_pose": "shared"}``.
        map_convention: how the maps count and order coordinates, a command's ``--map-convention``.
        mask: image whose white pixels are used, for all frames, or a folder of one per frame.
        pattern: in the images; default the coded grid. With ``stack``, ``gray``, ``phase`` or
            ``gray+phase`` each folder is a stack of photographs, and makes one frame.
        refine: whether decoded coordinates are refined on their images.
        second_round: whether images are read again along the epipolar lines of their calibration,
            and calibrated again if a tenth of the coordinates comes or goes. Not with ``resume``.
        resume: folder of an earlier calibration of these frames to go on with; it needs the very
            maps that one ended with, which after a second round are its ``observed.exr``.
        progress: called with the share of the work done and the name of the step.
        options: how to solve.

    Raises:
        InputError: something that cannot be used; says what and what to do.
        NothingDecodedError: no pattern in any image.
    """
    record = as_rig(rig)
    if share:
        record = with_plan(record, share, "share")
    frames, photographs = as_frames(captures), KeptPhotographs()
    maps = as_correspondences(frames, record, pattern, refine, map_convention, photographs.keep)
    masks = Masks.at(Path(mask)) if mask is not None else None
    if masks:
        maps = [masks.applied(map_) for map_ in maps]
    checkpoint = None if resume is None else load_checkpoint(resume)
    calibration = solve(maps, record, options, progress, checkpoint)
    images = photographs_in(frames, pattern) if refine and second_round and not checkpoint else []
    if images:
        more: dict[str, Any] = {"masked": masks.applied} if masks else {}
        if progress:
            more["progress"] = progress
        calibration = calibrated_again(calibration, maps, images, pattern, record, options, more)
    return Result(replace(calibration, photographs=photographs), record)


def decode(
    image: str | Path | Array, rig: RigInput, *, pattern: str | None = None, refine: bool = True
) -> CorrespondenceMap:
    """Decode an image of the coded grid.

    Args:
        image: a file, or an array (H, W) or (H, W, 3), 8 or 16 bits or 0 to 1.
        rig: sizes of image and pattern.
        pattern: in the image; default the coded grid.
        refine: whether coordinates are refined on the image.

    Returns:
        The map: ``q`` (H, W, 2) pattern pixels, NaN = missing, with weights and covariances.

    Raises:
        InputError: an image that cannot be used, or of another size than the rig's.
        NothingDecodedError: it does not show the pattern.
    """
    decoder = ImageDecoder(as_rig(rig), pattern, refine=refine)
    return decode_frame(decoder, as_image(image))


def render(scene: str | Path, *, spp: int = 64, seed: int = 0, **parameters: Any) -> Capture:
    """Render a scene: image, projector coordinates, depth, normals, masks and exact truth.

    Args:
        scene: an XML file, or the name of a packaged scene, e.g. ``stomach``.
        spp: samples per pixel of the image.
        seed: of its noise.
        parameters: of the scene, e.g. ``width=320``.

    Raises:
        InputError: an unknown scene or parameter.
    """
    return render_capture(load_scene(str(scene), **parameters), spp=spp, seed=seed)


def load(folder: str | Path) -> Result:
    """Read a solution folder that the command ``calibrate`` or :meth:`Result.save` wrote.

    Raises:
        InputError: a file is missing or damaged.
    """
    rig = Path(folder) / "rig.yaml"
    record = load_rig(rig) if rig.is_file() else None
    return Result(read_solution_folder(folder), record)
