"""Synthetic captures with truth, many at a time."""
