"""Stacks of photographs in other people's orders and codes."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mitsuba_endo.decoding.conventions import StackOrder, read_convention
from mitsuba_endo.decoding.phase_shift import PhaseConvention
from mitsuba_endo.decoding.stack import decode_stack
from mitsuba_endo.decoding.stack_files import StackFiles, stack_paths
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.decoding.stack_reading import StackRequest, find_reading, read_by_names

from .case import REFUSED, RIGHT, Case, Ending, beside
from .view import PATTERN, photographs, truth

Images = list[NDArray[np.uint8]]
MOST = 0.3
"""Pattern pixels of a right map's median error: what Gray code of one-pixel stripes reaches."""
GRAY = StackPlan.make("gray", *PATTERN)
PAIRS = StackPlan.make("gray", *PATTERN, inverse=True)
BOTH = StackPlan.make("gray+phase", *PATTERN)
SINE = PhaseConvention(1, 0.75)
CENTRED = PhaseConvention(1, round(-1 / 3 % 1, 9))


@cache
def _seen(plan: StackPlan) -> dict[str, NDArray[np.uint8]]:
    return dict(zip(plan.labels(), photographs(patterns(plan)), strict=True))


def ordered(plan: StackPlan, order: StackOrder, place: str = "first") -> Images:
    """Return the photographs of a plan in an order, white and black where ``place`` says."""
    seen = _seen(plan)
    rest = [seen[label] for label in order.labels(plan)]
    if not plan.reference:
        return rest
    two = [seen["white"], seen["black"]]
    return {"first": [*two, *rest], "last": [*rest, *two], "ends": [two[1], *rest, two[0]]}[place]


def save(folder: Path, images: Images) -> None:
    for k, image in enumerate(images):
        cv2.imwrite(str(folder / f"IMG_{k + 1}.png"), image)


def save_labelled(folder: Path, images: Images) -> None:
    for k, (label, image) in enumerate(zip(GRAY.labels(), images, strict=True)):
        cv2.imwrite(str(folder / f"{k:02d}_{label}.png"), image)


def save_pages(folder: Path, images: Images) -> None:
    pages = [Image.fromarray(image) for image in images]
    pages[0].save(folder / "stack.tif", save_all=True, append_images=pages[1:])


def read(folder: Path, **stated: object) -> Ending:
    """Read a stack as ``decode-stack`` does."""
    inside = [*folder.iterdir()]
    paths = stack_paths(inside if len(inside) == 1 else [folder])
    width, height = PATTERN
    request = StackRequest(**{"width": width, "height": height} | stated)  # type: ignore[arg-type]
    reading = read_by_names(paths, request)
    stack = StackFiles(paths)
    reading = reading or find_reading(stack, request)
    decoded = decode_stack(stack, reading.plan, order=reading.order)
    return Ending(beside(decoded.q, truth(), MOST), stack.notes[:1])


def case(
    brings: str,
    images: Callable[[], Images],
    save: Callable[[Path, Images], None] = save,
    *,
    options: str = "",
    refused: str = "",
    **stated: object,
) -> Case:
    """Return a case of a stack; ``options`` tells how ``stated`` is typed."""

    def run(folder: Path) -> Ending:
        save(folder, images())
        return read(folder, **stated)

    told = f" with `{options}`" if options else ""
    return Case("stack", brings + told, REFUSED if refused else RIGHT, refused, run)


def phased(plan: StackPlan, phase: PhaseConvention) -> StackPlan:
    return replace(plan, phase=phase)


def one_axis(plan: StackPlan, axis: str) -> Images:
    seen = _seen(plan)
    return [image for label, image in seen.items() if label[:2] not in ("x_", "y_")
            or label.startswith(axis)]  # fmt: skip


def _video(folder: Path, _images: Images) -> None:
    (folder / "stack.mp4").write_bytes(b"\0\0\0\x18ftypmp42")


def _one_size_off(folder: Path, images: Images) -> None:
    save(folder, [images[0][:-1], *images[1:]])


THIRDS = StackPlan.make("gray+phase", *PATTERN, steps=3)
BINARY = replace(GRAY, code="binary")
PHASE = StackPlan.make("phase", *PATTERN)
THREE = StackPlan.make("phase", *PATTERN, periods=(21, 18, 16))
TWO_BY_THREE = StackPlan.make("phase", *PATTERN, periods=(17, 16), steps=3)
FRINGES = StackPlan.make("gray+phase", *PATTERN, stripe=16)
HALVES = StackPlan.make("gray+phase", *PATTERN, stripe=8)
UNEVEN = StackPlan.make("gray", *PATTERN, stripe=PATTERN[0] / 128)
COLUMNS = StackOrder()

CASES = [
    case("Gray code, named by the command `patterns`", lambda: ordered(GRAY, COLUMNS),
         save_labelled),
    case("Gray code, numbered 1, 2, ... 10 without zeros", lambda: ordered(GRAY, COLUMNS)),
    case("Gray code, one TIFF file of pages", lambda: ordered(GRAY, COLUMNS), save_pages),
    case("Gray code, rows first", lambda: ordered(GRAY, StackOrder(rows_first=True))),
    case("Gray code, least significant bit first",
         lambda: ordered(GRAY, StackOrder(fine_first=True))),
    case("inverses beside, white and black last (kamino)",
         lambda: ordered(PAIRS, StackOrder(inverses="after"), "last")),
    case("all inverses at the end, black first, white last",
         lambda: ordered(PAIRS, StackOrder(inverses="last"), "ends")),
    case("Gray code without white and black",
         lambda: ordered(replace(GRAY, reference=False), COLUMNS)),
    case("plain binary code", lambda: ordered(BINARY, COLUMNS)),
    case("Gray code and four steps of a cosine", lambda: ordered(BOTH, COLUMNS)),
    case("Gray code and four steps of a sine", lambda: ordered(phased(BOTH, SINE), COLUMNS)),
    case("Gray code and three centred steps", lambda: ordered(phased(THIRDS, CENTRED), COLUMNS)),
    case("phases from coarse to fine, all of y first",
         lambda: ordered(PHASE, StackOrder(rows_first=True))),
    case("three frequencies, none spans the pattern", lambda: ordered(THREE, COLUMNS),
         options="--pattern phase --periods 21,18,16", kind="phase", periods=(21.0, 18.0, 16.0)),
    case("two frequencies of three steps", lambda: ordered(TWO_BY_THREE, COLUMNS),
         options="--pattern phase --periods 17,16", kind="phase", periods=(17.0, 16.0)),
    case("two frequencies that repeat within the pattern", lambda: ordered(THREE, COLUMNS),
         options="--pattern phase --periods 20,16", kind="phase", periods=(20.0, 16.0),
         refused="do not tell all of the pattern's 262 pixels apart"),
    case("stripes as wide as the fringes", lambda: ordered(FRINGES, COLUMNS)),
    case("complementary Gray code", lambda: ordered(HALVES, COLUMNS)),
    case("seven bits stretched over the pattern", lambda: ordered(UNEVEN, COLUMNS),
         options="--stripe 2.046875", stripe=UNEVEN.stripe),
    case("columns alone", lambda: one_axis(GRAY, "x_"), refused="only columns or only rows"),
    case("rows alone, with phases", lambda: one_axis(BOTH, "y_"),
         refused="only columns or only rows"),
    case("one photograph missing", lambda: ordered(GRAY, COLUMNS)[:-1],
         options="--pattern gray --no-inverse --stripe 1", kind="gray", inverse=False, stripe=1.0,
         refused="images, but"),
    case("photographs in disorder", lambda: [image for k in range(3)
         for image in ordered(GRAY, COLUMNS)[k::3]], refused="none of"),
    case("a camera that mirrors", lambda: [image[:, ::-1] for image in ordered(GRAY, COLUMNS)],
         refused="is mirrored"),
    case("another convention than what is stated", lambda: ordered(GRAY, COLUMNS),
         options="--convention rows-first", refused="none of",
         convention=read_convention("rows-first")),
    case("a pattern of another size", lambda: ordered(GRAY, COLUMNS), options="--width 131",
         width=131, refused="but such patterns have"),
    case("a video of the patterns", list, _video, refused="is a video"),
    case("photographs of two sizes", lambda: ordered(GRAY, COLUMNS), _one_size_off,
         refused="give images of one size"),
]  # fmt: skip
