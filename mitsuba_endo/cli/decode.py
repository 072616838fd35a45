"""``mitsuba-endo decode``: from images of the coded grid to correspondence maps."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import EXIT_FAULT, Debug, Json, Quiet, Session, session
from .map_options import Mask

if TYPE_CHECKING:
    from ..decoding.grid.decode import DecodedGrid
    from ..decoding.image_files import ImageFrame
    from ..records.rig import Rig
    from ..refine.decoded import DecodedMap

Images = Annotated[
    list[Path],
    typer.Argument(metavar="IMAGE...", help="Images, folders of images, or videos."),
]
RigFile = Annotated[Path, typer.Option("--rig", help="Rig file: size of image and pattern.")]
Out = Annotated[Path, typer.Option("--out", help="Folder to write.")]
Pattern = Annotated[
    str, typer.Option(help="The projected pattern, e.g. pattern:coded?seed=3; size as in the rig.")
]
Weights = Annotated[
    Path | None, typer.Option(help="Another decoder network, as an ONNX file.", show_default=False)
]
Refine = Annotated[
    bool,
    typer.Option(
        "--refine/--no-refine", help="Refine decoded coordinates on the image, or keep them."
    ),
]
DEFAULT = "pattern:coded"


@dataclass(frozen=True)
class Summary:
    """What was found in one image."""

    name: str
    nodes: int
    """Nodes with links."""
    placed: int
    """Of them, identified in the pattern."""
    coverage: float
    """Share of the pixels that have a coordinate."""
    reason: str
    """Why nothing was decoded; empty if something was."""
    refined: float | None
    """Share of the decoded pixels that the image confirmed; None: not tried."""
    unrefined: str
    """Why the decoder's map was kept as it is; empty if it was refined or that was not tried."""

    def line(self) -> str:
        if self.reason:
            return f"{self.name}: nothing decoded: {self.reason}."
        refined = (
            ""
            if self.refined is None
            else f" Not refined: {self.unrefined}."
            if self.unrefined
            else f" {100 * self.refined:.1f} % of them refined on the image."
        )
        return (
            f"{self.name}: {self.placed} of {self.nodes} nodes identified, "
            f"{self.nodes - self.placed} rejected, {100 * self.coverage:.1f} % of the pixels "
            f"decoded.{refined}"
        )


def decode(
    images: Images,
    rig: RigFile,
    out: Out,
    pattern: Pattern = DEFAULT,
    weights: Weights = None,
    refine: Refine = True,
    mask: Mask = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Decode images of the coded grid into correspondence maps, one a frame.

    NAME.exr is the map, with confidence, weight and covariance beside the coordinates;
    NAME_graph.png shows the grid found. An image without this pattern gets no map; if that is
    every one, the exit code is 3.
    """
    with session(quiet, as_json, debug) as output:
        from ..files import atomic_folder
        from ..folder_mark import Kind
        from ..outputs import prepare_folder
        from ..records.rig import load_rig

        prepare_folder(out, Kind.MAPS, [*images, *(path for path in (rig, weights, mask) if path)])
        record = load_rig(rig)
        with atomic_folder(out, Kind.MAPS) as folder:
            summaries = decode_into(folder, images, record, pattern, weights, refine, output, mask)
            refuse_nothing(summaries)
        decoded = [one for one in summaries if not one.reason]
        output.print(*(one.line() for one in summaries))
        output.summary({"folder": str(out), "frames": [_fields(one) for one in summaries]})
        raise typer.Exit(0 if len(decoded) == len(summaries) else EXIT_FAULT)


def decode_into(
    folder: Path,
    images: Sequence[Path],
    rig: "Rig",
    pattern: str | None,
    weights: Path | None,
    refine: bool,
    output: Session,
    mask: Path | None = None,
) -> list[Summary]:
    """Decode images, write maps and pictures of those with a pattern, and say what was found.

    Raises:
        InputError: an image that cannot be read or is not of the rig's size, a wrong pattern or
            network.
    """
    from dataclasses import replace

    from ..decoding.image_files import read_frames
    from ..decoding.masks import Masks
    from ..refine.image_decoder import ImageDecoder

    decoder = ImageDecoder(rig, pattern, weights, refine=refine)
    masks = Masks.at(mask) if mask else None
    summaries, notes = [], set()
    with output.progress("Decoding") as advance:
        for k, frame in enumerate(read_frames(images), 1):
            of = f"frame {k}" if len(images) == 1 else f"frame {k} of {max(k, len(images))}"
            advance(0.0, f"Decoding {frame.name}, {of}")
            if frame.note and frame.note not in notes:
                output.print(f"warning: {frame.note}")
            notes.add(frame.note)
            decoded = decoder.decode(frame)
            map_ = decoded.map
            if masks:
                map_ = replace(map_, map=masks.applied(map_.map))
            summaries.append(_summary(frame.name, decoded.grid, map_))
            _write(folder, frame, decoded.grid, map_)
    return summaries


def _summary(name: str, result: "DecodedGrid", map_: "DecodedMap") -> Summary:
    refined, unrefined = (
        (None, "") if map_.refined is None else (map_.refined.refined, map_.refined.reason)
    )
    placed, coverage = int(result.assignment.assigned.sum()), float(map_.map.valid.mean())
    return Summary(name, result.nodes, placed, coverage, result.reason, refined, unrefined)


def decode_images(
    paths: list[Path],
    rig_file: Path,
    pattern: str | None,
    refine: bool,
    aside: Path,
    output: Session,
    map_convention: str = "",
) -> list[Path]:
    """Return correspondence maps: those given, or those of the images given, written to ``aside``.

    Raises:
        InputError: maps and images at once, a pattern for maps, a convention of maps for images,
            no pattern found in any image, or as :func:`decode_into`.
    """
    from ..decoding.image_files import is_images
    from ..errors import InputError
    from ..records.rig import load_rig
    from .stack_frames import decode_stacks

    images = [path for path in paths if is_images(path)]
    if images and pattern is not None and _is_stack(pattern):
        if not refine:
            raise InputError("is for images of the coded grid", "--no-refine", "leave it out")
        if map_convention:
            raise InputError("is for maps", "--map-convention", "leave it out")
        return decode_stacks(paths, rig_file, pattern, aside, output)
    if not images:
        if pattern is not None:
            raise InputError("is for images, and maps are given", "--pattern", "leave it out")
        if not refine:
            raise InputError("is for images, and maps are given", "--no-refine", "leave it out")
        return paths
    if len(images) < len(paths):
        raise InputError("maps and images are given", str(images[0]), "give one kind")
    if map_convention:
        raise InputError("is for maps, and images are given", "--map-convention", "leave it out")
    rig = load_rig(rig_file)
    summaries = decode_into(aside, images, rig, pattern, None, refine, output)
    refuse_nothing(summaries)
    output.print(*(one.line() for one in summaries))
    return [map_path(aside, one.name) for one in summaries if not one.reason]


def _is_stack(pattern: str) -> bool:
    """Tell whether the name of a pattern is that of a stack of photographs."""
    from ..decoding.stack_map import KINDS

    return pattern in KINDS


def refuse_nothing(summaries: Sequence[Summary]) -> None:
    """Refuse images none of which shows the pattern.

    Raises:
        NothingDecodedError: says why for the first one.
    """
    from ..errors import NothingDecodedError

    if summaries and all(one.reason for one in summaries):
        first = summaries[0]
        where = first.name if len(summaries) == 1 else f"{first.name} and {len(summaries) - 1} more"
        todo = "check the pattern, light and focus; photographs of a stack take --pattern stack"
        raise NothingDecodedError(first.reason, where, todo)


def map_path(folder: Path, frame: str) -> Path:
    """Return where the map of a frame is written."""
    return folder / f"{frame}.exr"


def _write(folder: Path, frame: "ImageFrame", result: "DecodedGrid", map_: "DecodedMap") -> None:
    from ..png import write_png
    from ..records.correspondence import write_map
    from ..show.grid_picture import grid_picture
    from ..show.photographs import photograph_path, save_photograph

    picture = grid_picture(frame.image, result)
    write_png(folder / f"{frame.name}_graph.png", picture)
    if result.reason:
        return
    save_photograph(photograph_path(folder, frame.name), frame.image)
    write_map(map_path(folder, frame.name), map_.map, {"confidence": map_.confidence})


def _fields(one: Summary) -> dict[str, Any]:
    from dataclasses import asdict

    return asdict(one)
