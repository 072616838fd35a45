"""``mitsuba-endo refine``: a map of any decoder, refined on the image that it came from."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import EXIT_FAULT, Debug, Json, Quiet, session
from .map_options import MapConvention, Mask, mask_files

if TYPE_CHECKING:
    from ..records.rig import Rig
    from ..refine.pattern_image import PatternImage

Map = Annotated[Path, typer.Argument(metavar="MAP", help="Map of any decoder, .exr or .npz.")]
ImageFile = Annotated[Path, typer.Option("--image", help="Image that the map came from.")]
RigFile = Annotated[Path, typer.Option("--rig", help="Rig file: size of image and pattern.")]
Pattern = Annotated[
    str,
    typer.Option(help="The projected pattern: an image file, or e.g. pattern:coded?seed=3."),
]
Out = Annotated[Path, typer.Option("--out", help="Map to write, .exr or .npz.")]
Gamma = Annotated[
    float,
    typer.Option(min=0.1, max=5, help="The image holds brightness^(1/gamma); 1 for linear ones."),
]
PatternGamma = Annotated[
    float, typer.Option(min=0.1, max=5, help="The same of a pattern given as an image.")
]


def refine(
    map_file: Map,
    image: ImageFile,
    rig: RigFile,
    pattern: Pattern,
    out: Out,
    gamma: Gamma = 2.2,
    pattern_gamma: PatternGamma = 1.0,
    map_convention: MapConvention = "",
    mask: Mask = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Refine a correspondence map on the image that it came from.

    The pattern is warped by the map and compared with the image; the map written has covariances.
    If the image confirms nothing, the map is written as it was, and the exit code is 1.
    """
    with session(quiet, as_json, debug) as output:
        from ..decoding.image_files import full_scale, open_image
        from ..decoding.masks import Masks
        from ..outputs import prepare_file
        from ..records.correspondence import check_map_path, load_map, write_map
        from ..records.map_convention import read_map_convention
        from ..records.rig import load_rig
        from ..refine.options import RefineOptions
        from ..refine.refine_map import refine_map

        check_map_path(out)
        drawn = [] if pattern.startswith("pattern:") else [Path(pattern)]
        prepare_file(out, [map_file, image, rig, *drawn, *mask_files(mask)])
        record = load_rig(rig)
        size = record.projector.width, record.projector.height
        start = load_map(map_file, read_map_convention(map_convention), size)
        start = Masks.at(mask).applied(start) if mask else start
        texture = _pattern(pattern, record, pattern_gamma)
        stored = open_image(image)
        if stored.note:
            output.print(f"warning: {stored.note}")
        raw = stored.pixels
        result = refine_map(start, raw / full_scale(raw), texture, RefineOptions(gamma=gamma))
        write_map(out, result.map)
        output.print(
            f"{out}: not refined: {result.reason}; the map is as it was."
            if result.reason
            else f"{out}: {100 * result.refined:.1f} % of the pixels refined, {result.grown} "
            f"added, {result.dropped} dropped."
        )
        output.summary(
            {"map": str(out), "refined": result.refined, "grown": result.grown,
             "dropped": result.dropped, "blur": result.blur, "reason": result.reason}
        )  # fmt: skip
        raise typer.Exit(EXIT_FAULT if result.reason else 0)


def _pattern(name: str, rig: "Rig", gamma: float) -> "PatternImage":
    from ..decoding.pattern_option import coded_grid
    from ..errors import InputError
    from ..refine.pattern_image import grid_image, load_pattern

    size = rig.projector.width, rig.projector.height
    if not name.startswith("pattern:"):
        return load_pattern(Path(name), *size, gamma)
    if gamma != 1:
        raise InputError("is for patterns given as images", "--pattern-gamma", "leave it out")
    return grid_image(coded_grid(name, *size))
