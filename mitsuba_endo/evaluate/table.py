"""A table of an evaluation, in words, whoever prints it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ErrorTable:
    """Rows of texts under a title."""

    title: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]
    note: str = ""
    """A sentence under the table."""
