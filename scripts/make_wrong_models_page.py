"""Write docs/wrong_models.md: what the program says to six wrong models and a right one.

Run from the repository: ``python -m scripts.make_wrong_models_page``.
"""

import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

from mitsuba_endo import backend

sys.path.insert(0, str(Path(__file__).parent))
from benchmarks.model_error import RIGHT, solution_of

PAGE = Path(__file__).parents[1] / "docs" / "wrong_models.md"
SEED = 4003
"""None of those that tuned, or judge."""
SHOWN = {
    "no distortion": "The camera's lens has k1 = -0.12; the rig leaves `distortion` out.",
    "camera k1 + 0.01": "`distortion` begins with -0.11 in place of -0.12.",
    "camera focal 20 %": "`K` has focal lengths that are 20 % too long.",
    "other law": "The projector is diffractive; the rig says `law: pinhole`.",
    "projector centre": "`centre` is off by 20 and -10 pattern pixels.",
    "clamped, but moves": "Four frames; the rig says `projector_pose: shared`, and from one to the "
    "next the projector turns by about a degree and moves by 0.1 mm.",
}
"""Kinds of the benchmark, and what is wrong in words."""
_HEAD = """# Six wrong models

What the verdict says of the model when something that was given is wrong. Each time a sheet at
70 mm, 128 x 96 correspondences with 0.2 px of noise and 10 % of outliers, and all else right. The
page is written by `python -m scripts.make_wrong_models_page`, from a draw that was not chosen: not
every cause is named rightly. How often they are found and named is in
[the benchmarks](benchmark.md#wrong-models).
"""


def sections() -> list[str]:
    """Return the page part by part: its head, the right model, and every wrong one."""
    return [_HEAD, f"## Nothing is wrong\n\n{_said(RIGHT)}", *map(_section, SHOWN)]


def _section(kind: str) -> str:
    return f"## {kind[0].upper()}{kind[1:]}\n\n{SHOWN[kind]}\n\n{_said(kind)}"


def _said(kind: str) -> str:
    """Return what a calibration states of its focal length and its model, as a quotation."""
    solution, truth = solution_of(kind, SEED)
    lines = [s for s in solution.verdict if s.startswith(("Focal length", "Model"))]
    lines.append(f"(True focal length: {truth:.6g} px.)")
    return "\n>\n".join(f"> {line}" for line in lines) + "\n"


def main() -> None:
    """Write the page."""
    backend.use()
    with threadpool_limits(1, "blas"):
        text = "\n".join(sections())
    PAGE.write_text(text.rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
