"""What the residuals say of the model, for ``solution.json`` and in words."""

from typing import Any

from ..inference.fit import Fit
from ..inference.model_error.analysis import ModelCheck
from ..inference.model_error.refits import MATRIX
from ..inference.model_error.score_tests import ModelCandidate
from ..inference.model_error.unchecked import Unchecked
from ..unknowns.block import BLOCKS

_LISTED = 6
"""Candidates that are recorded."""
_NAMED = 4
"""Members of a group that are named in a sentence; of a larger one it is said that it is large."""
_TOLD = 0.005
"""Share of structure that is told: less rounds to 0 %."""


def model_section(fit: Fit) -> dict[str, Any]:
    """Return the section ``model`` of a solution, empty where the model was not checked."""
    check = fit.model
    if check is None:
        return {}
    structure, refuted = check.tests.before.structure, check.refuted_plan
    return {
        "structure": structure.ratio,
        "expected": structure.white,
        "deviations": structure.deviations,
        "remaining_structure": check.tests.after.structure.ratio,
        "design_effect": check.tests.before.effect.largest,
        "intervals_by": check.effect**0.5,
        "suspected": check.wrong,
        "unexplained": check.unexplained,
        "candidates": [_candidate(check, c) for c in check.causes.candidates[:_LISTED]],
        "plan": [
            {"block": p.block, "mode": p.mode, "chance": p.chance, "refuted": p in refuted}
            for p in check.plan
        ],
        "unchecked": [_unchecked(u) for u in check.unchecked],
        "corrected": check.corrects,
        "doubted": [] if check.nuisance is None else list(check.nuisance.blocks),
        "conclusion": conclusion(check),
    }


def conclusion(check: ModelCheck) -> str:
    """Say in a sentence or three whether the model explains the residuals."""
    structure = check.tests.before.structure
    if check.of_decoder:
        return (
            f"{100 * structure.excess:.0f} % of the residuals is structure as a decoder's errors "
            "have it, which the intervals count"
        )
    if not check.wrong:
        return "; ".join(["the residuals look like noise", *map(blind_spot, check.unchecked[:1])])
    out = [
        f"{100 * structure.excess:.0f} % of the residuals is structure that the model leaves out"
        if structure.excess > _TOLD
        else "the residuals accuse a value that was given"
    ]
    out += [plan_advice(p.words) for p in check.refuted_plan[:1]]
    if not check.refuted_plan:
        accused = [suspicion(c) for c in check.accused[:1]]
        out += accused or ["nothing that was tried explains it: decoder, surface or light may"]
    if check.nuisance is not None and check.nuisance.blocks:
        what = "values and intervals" if check.corrects else "the intervals"
        out.append(f"{what} allow for errors of what was given")
    return "; ".join(out)


def blind_spot(value: Unchecked) -> str:
    """Say what would leave no trace in the residuals, and what it would do."""
    unit = f" {value.unit}" if value.unit else ""
    whose = "" if value.words.startswith(("camera", "projector")) else "projector's "
    return (
        f"they would too if the {whose}{value.words} were {value.error:.2g}{unit} off, which moves "
        f"focal length or pose by up to {value.moved:.0f} stated deviations: make sure of it, or "
        "add a frame that sees more relief"
    )


def plan_advice(words: str) -> str:
    """Say which mode of sharing the frames support."""
    return f"each frame wants its own {words}: the plan does not fit, use per_frame for it"


def suspicion(candidate: ModelCandidate) -> str:
    """Name the candidate that explains most, what mends it, and what cannot be told from it."""
    if _is_whole(candidate):
        text = f"{candidate.words} looks wrong as a whole"
    elif candidate.unit or candidate.block:
        value = f"{abs(candidate.value):.2g} {candidate.unit}".strip()
        side = "small" if candidate.value > 0 else "large"
        text = f"{candidate.words} looks {value} too {side}"
    else:
        text = f"{candidate.words} would fit better"
    text += f" (explains {100 * candidate.share:.0f} %)"
    others = [words for _, words in candidate.group]
    if len(others) > _NAMED:
        text += f", or it is {others[0]} or one of {len(others) - 1} others, which look alike"
    elif others:
        text += f", or it is {' or '.join(others)}, which look alike"
    return f"{text}: {_todo(candidate)}"


def _is_whole(candidate: ModelCandidate) -> bool:
    """Tell whether a candidate is several values together, which no number describes."""
    return candidate.key == MATRIX or (candidate.key in BLOCKS and not candidate.unit)


def _todo(candidate: ModelCandidate) -> str:
    if candidate.block is None:
        return "compare projection models (law: auto) and check lens and decoder"
    device = "camera" if candidate.block.startswith("camera") else "projector"
    return f"recalibrate the {device}, or refine it with --share {candidate.block}=shared"


def model_warnings(fit: Fit) -> list[str]:
    """Return what must be known before trusting the values; nothing where the model holds."""
    check = fit.model
    if check is None or not check.wrong:
        return []
    return [f"the model does not explain the residuals: {conclusion(check)}"]


def _unchecked(value: Unchecked) -> dict[str, Any]:
    return {
        "key": value.key, "words": value.words, "error": value.error, "unit": value.unit,
        "moves_by": value.moved,
    }  # fmt: skip


def _candidate(check: ModelCheck, c: ModelCandidate) -> dict[str, Any]:
    names = [] if c.block is None else [BLOCKS[c.block].words]
    whole = _is_whole(c)
    return {
        "key": c.key, "words": c.words, "value": None if whole else c.value,
        "std": None if whole else c.std, "unit": c.unit,
        "share": c.share, "significant": c in check.accused,
        "block": (names or [""])[0], "group": [words for _, words in c.group],
        "group_keys": [key for key, _ in c.group],
    }  # fmt: skip
