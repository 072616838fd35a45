"""What a report says of a result: plain values, which the templates place and escape."""

import json
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from ..records.solution import Outcome, Solution
from .solution_values import Row, headline, rows

FOLDED = 3
"""Frames up to which all numbers stand open; of more, plots stand for them."""


@dataclass(frozen=True)
class ToldVerdict:
    """What was measured, what was not, and what to be wary of."""

    outcome: str
    settled: bool
    facts: list[str]
    """The most important numbers, for a line."""
    sentences: list[str]
    notes: list[str]


@dataclass(frozen=True)
class ComparedRow:
    """One quantity of several results."""

    group: str
    quantity: str
    cells: list[str]
    unit: str


@dataclass(frozen=True)
class Provenance:
    """How a result came about."""

    facts: list[tuple[str, str]]
    details: list[tuple[str, str]]
    """Titles and JSON texts."""


def verdict_of(solution: Solution) -> ToldVerdict:
    """Return the verdict with what was given, and the warnings with the frames left out."""
    settled = solution.outcome in (Outcome.CONVERGED, Outcome.TRUTH)
    outcome, *facts = headline(solution).split("; ")
    sentences = solution.verdict or ["The solution holds no verdict."]
    notes = [
        *solution.warnings,
        *(
            f"Frame {left.name} is left out: {left.reason}"
            for left in solution.left_out
            if not any(left.name in warning for warning in solution.warnings)
        ),
    ]
    return ToldVerdict(outcome, settled, facts, [*sentences, given(solution)], notes)


def given(solution: Solution) -> str:
    """Say which values are input, not results."""
    projector = solution.projector
    names = {
        "focal length": projector.focal, "centre": projector.centre, "aspect": projector.aspect,
        "distortion": projector.distortion,
    }  # fmt: skip
    fixed = [f"projector {name}" for name, e in names.items() if e.status == "fixed"]
    return f"Given, not measured: {', '.join(['camera intrinsics', *fixed])}."


def number_groups(solution: Solution) -> list[tuple[str, list[Row]]]:
    """Return the values by the device or frame that they belong to."""
    return [
        (name, list(members)) for name, members in groupby(rows(solution), lambda row: row.group)
    ]


def candidates(solution: Solution) -> list[dict[str, Any]]:
    """Return what may be wrong with the model, by how much of the residuals it explains."""
    return [
        {
            "words": c["words"], "off_by": _off_by(c), "share": f"{100 * c['share']:.0f}",
            "group": ", ".join(c["group"]),
        }
        for c in solution.model.get("candidates", [])
    ]  # fmt: skip


def _off_by(candidate: dict[str, Any]) -> str:
    """Say by how much a value is off; nothing for several together."""
    if candidate["value"] is None or candidate["std"] is None:
        return ""
    return f"{candidate['value']:+.3g} ± {candidate['std']:.2g} {candidate['unit']}"


def comparison(solutions: list[Solution]) -> list[ComparedRow]:
    """Set the same quantities of several solutions side by side; frames are matched by order."""
    columns = [_keyed(s) for s in solutions]
    keys = list(dict.fromkeys(key for column in columns for key in column))
    return [
        ComparedRow(
            *key, [_cell(column.get(key)) for column in columns],
            next(column[key].unit for column in columns if key in column),
        )
        for key in keys
    ]  # fmt: skip


def _keyed(solution: Solution) -> dict[tuple[str, str], Row]:
    order = {f.name: f"Frame {i + 1}" for i, f in enumerate(solution.frames)}
    return {(order.get(r.group, r.group), r.quantity): r for r in rows(solution)}


def _cell(row: Row | None) -> str:
    return "-" if row is None else f"{row.value} {row.interval}"


def provenance_of(solution: Solution) -> Provenance:
    """Return versions, timings, options with the seed, the rig."""
    versions = ", ".join(f"{k} {v}" for k, v in solution.versions.items()) or "not recorded"
    seconds = ", ".join(f"{k} {v:.1f} s" for k, v in solution.timings.items()) or "not recorded"
    seed = solution.configuration.get("options", {}).get("seed", "not recorded")
    law = solution.projector.law.replace("_", " ")
    details = [
        (title, json.dumps(data, indent=1, ensure_ascii=False))
        for title, data in (
            ("Configuration", solution.configuration), ("Law evidence", solution.law_evidence),
        )
        if data
    ]  # fmt: skip
    facts = [
        ("Projection model", law), ("Seed", str(seed)), ("Times", seconds), ("Versions", versions),
    ]  # fmt: skip
    return Provenance(facts, details)
