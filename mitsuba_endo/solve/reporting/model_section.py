"""What the residuals say of the model, for ``solution.json`` and in words."""

from typing import Any

from ...records.solution import Outcome
from ..inference.fit import Fit
from ..inference.model_error.analysis import ModelCheck
from ..inference.model_error.score_tests import ModelCandidate
from ..unknowns.block import BLOCKS

_LISTED = 6
"""Candidates that are recorded."""
_NAMED = 3
"""Members of a group that are named in a sentence."""


def model_section(fit: Fit) -> dict[str, Any]:
    """Return the section ``model`` of a solution, empty where the model was not checked."""
    check = fit.model
    if check is None:
        return {}
    structure = check.tests.before.structure
    return {
        "structure": structure.ratio,
        "expected": structure.white,
        "deviations": structure.deviations,
        "remaining_structure": check.final.structure.ratio,
        "design_effect": check.tests.before.effect.largest,
        "intervals_by": check.effect**0.5,
        "suspected": check.wrong,
        "candidates": [_candidate(check, c) for c in check.tests.candidates[:_LISTED]],
        "plan": [{"block": p.block, "mode": p.mode, "chance": p.chance} for p in check.plan],
        "carried": list(check.carried),
        "conclusion": conclusion(check),
    }


def conclusion(check: ModelCheck) -> str:
    """Say in a sentence or three whether the model explains the residuals."""
    if not check.wrong:
        return "the residuals look like noise"
    structure = check.tests.before.structure
    out = [
        f"{100 * structure.excess:.0f} % of the residuals is structure that the model leaves out"
        if structure.excess > 0.005
        else "the residuals accuse a value that was given"
    ]
    out += [plan_advice(p.words) for p in check.refuted_plan[:1]]
    if not check.refuted_plan:
        accused = [suspicion(check, c) for c in check.accused[:1]]
        out += accused or ["nothing that was tried explains it"]
    if check.carried:
        out.append("what was given counts as known to the precision of careful calibrations only")
    return "; ".join(out)


def plan_advice(words: str) -> str:
    """Say which mode of sharing the frames support."""
    return f"each frame wants its own {words}: the plan does not fit, use per_frame for it"


def suspicion(check: ModelCheck, candidate: ModelCandidate) -> str:
    """Name the candidate that explains most, what mends it, and what cannot be told from it."""
    share = 100 * check.share(candidate.gain)
    if candidate.unit or candidate.block:
        value = f"{abs(candidate.value):.2g} {candidate.unit}".strip()
        side = "small" if candidate.value > 0 else "large"
        text = f"{candidate.words} looks {value} too {side}"
    else:
        text = f"{candidate.words} would fit better"
    text += f" (explains {share:.0f} %)"
    if candidate.group:
        text += f", or it is {' or '.join(candidate.group[:_NAMED])}, which look alike"
    return f"{text}: {_todo(candidate)}"


def _todo(candidate: ModelCandidate) -> str:
    if candidate.block is None:
        return "compare projection models (law: auto) and check lens and decoder"
    device = "camera" if candidate.block.startswith("camera") else "projector"
    return f"recalibrate the {device}, or refine it with --share {candidate.block}=shared"


def model_warnings(fit: Fit) -> list[str]:
    """Return what must be known before trusting the values; nothing where the model holds."""
    check = fit.model
    if check is None or not check.wrong or fit.result.outcome is Outcome.INTERRUPTED:
        return []
    return [f"the model does not explain the residuals: {conclusion(check)}"]


def _candidate(check: ModelCheck, c: ModelCandidate) -> dict[str, Any]:
    names = [] if c.block is None else [BLOCKS[c.block].words]
    return {
        "key": c.key, "words": c.words, "value": c.value, "std": c.std, "unit": c.unit,
        "share": check.share(c.gain), "significant": c in check.accused,
        "block": (names or [""])[0], "group": list(c.group),
    }  # fmt: skip
