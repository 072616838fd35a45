"""Write docs/inputs.md: inputs as other people bring them, and what becomes of each.

Run from the repository: ``python -m scripts.make_inputs_page``.
"""

import re
import tempfile
from pathlib import Path

from scripts.inputs import cameras, images, maps, meshes, stacks
from scripts.inputs.case import REFUSED, SHOWN, Case, Outcome, outcome_of

PAGE = Path(__file__).parents[1] / "docs" / "inputs.md"
CASES: list[Case] = [*maps.CASES, *stacks.CASES, *images.CASES, *cameras.CASES, *meshes.CASES]
TITLES = {"map": "Correspondence maps", "stack": "Stacks of photographs",
          "image": "Images and videos", "camera": "Camera files", "mesh": "Surfaces"}  # fmt: skip
_HEAD = """# Inputs of other tools

What becomes of {count} inputs as other people bring them, with no other options than those named.
`python -m scripts.make_inputs_page` makes each of them, reads it, compares it with what it was
made from, and writes this page; `tests/docs/test_inputs.py` does the same again. None ends in a
wrong answer without a word. The words of `--map-convention` are explained in
[Conventions](conventions.md#maps-of-other-tools), those of stacks in
[Commands](commands.md#stacks-of-other-people), the formats of camera files in
[The rig file](rig.md#camera). `sequence` reads maps, masks and images in the same way.
"""


def row(case: Case, outcome: Outcome) -> str:
    """Return a line of the table."""
    said = re.sub(r"\s+", " ", outcome.said).replace("|", "\\|")
    said = f"{said[:SHOWN].rstrip()} ..." if len(said) > SHOWN else said
    end = f"{outcome.outcome}: *{said}*" if said else outcome.outcome
    return f"| {case.brings} | {end} |"


def outcome(case: Case) -> Outcome:
    """Run a case in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return outcome_of(case, Path(folder))


def page(outcomes: list[Outcome]) -> str:
    """Return the page."""
    parts = [_HEAD.format(count=len(CASES))]
    for kind, title in TITLES.items():
        rows = [row(c, o) for c, o in zip(CASES, outcomes, strict=True) if c.kind == kind]
        parts.append("\n".join([f"## {title}", "", "| Brought | Outcome |", "|---|---|", *rows]))
    refused = sum(one.outcome == REFUSED for one in outcomes)
    parts.append(f"{len(CASES) - refused} of {len(CASES)} are read, {refused} refused by name.\n")
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


if __name__ == "__main__":
    found = [outcome(case) for case in CASES]
    for one, end in zip(CASES, found, strict=True):
        print(
            "ok " if end.agrees(one) else "NOT",
            one.kind,
            one.brings,
            "|",
            end.outcome,
            end.said[:150],
        )
    PAGE.write_text(page(found), "utf-8")
