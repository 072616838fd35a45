"""Comparison of a solution with the truth."""
