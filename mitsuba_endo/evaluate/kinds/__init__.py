"""Kinds of results that ``evaluate`` compares, one file a kind."""

from . import calibration
from .registry import KINDS, Evaluated, evaluate_result, register_evaluation

__all__ = ["KINDS", "Evaluated", "calibration", "evaluate_result", "register_evaluation"]
