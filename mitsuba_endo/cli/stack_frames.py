"""Stacks as frames of a calibration: each folder of photographs becomes a map."""

from pathlib import Path

from .console import Session


def decode_stacks(
    stacks: list[Path], rig_file: Path, pattern: str, aside: Path, output: Session
) -> list[Path]:
    """Decode a stack for each frame, and return the maps that were written to ``aside``.

    Args:
        stacks: folders of photographs, or TIFF files of pages, one a frame.
        rig_file: size of the pattern.
        pattern: see :mod:`..decoding.stack_map`.
        aside: folder to write.
        output: told what was found.

    Raises:
        InputError: a path is neither, a stack fits no reading or two, or two have one name.
        NothingDecodedError: a stack shows no pattern.
    """
    from ..errors import InputError
    from ..records.rig import load_rig

    rig = load_rig(rig_file)
    size = rig.projector.width, rig.projector.height
    names = [path.resolve().stem for path in stacks]
    for name in names:
        if names.count(name) > 1:
            raise InputError("two stacks have this name", name, "rename one folder")
    return [
        _decode(path, aside / f"{name}.exr", size, pattern, output)
        for path, name in zip(stacks, names, strict=True)
    ]


def _decode(stack: Path, out: Path, size: tuple[int, int], pattern: str, output: Session) -> Path:
    from ..decoding.stack_map import stack_map
    from ..records.correspondence import write_map

    with output.progress(f"Decoding {stack}") as advance:
        decoding = stack_map(
            stack, size, pattern, lambda share: advance(share, f"Decoding {stack}")
        )
    write_map(out, decoding.map)
    output.print(
        *([f"warning: {decoding.note}"] if decoding.note else []),
        f"{stack}: read as --pattern {decoding.reading.plan.kind} "
        f"--convention {','.join(decoding.reading.words)}; "
        f"{100 * decoding.decoded:.1f} % of the lit pixels decoded.",
    )
    return out
