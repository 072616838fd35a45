"""Formulas of the documentation as MathML: no script, no font, nothing fetched by the reader."""

import re
from typing import Any

from latex2mathml.converter import convert  # pyright: ignore[reportMissingImports]

_CODE = re.compile(r"(^ *(`{3,}|~{3,}).*?^ *\2 *$|`[^`\n]+`)", re.DOTALL | re.MULTILINE)
_FORMULA = re.compile(
    r"\$\$(?P<block>.+?)\$\$|(?<![\\$\w])\$(?P<inline>[^$\n]+?)\$(?![\w$])", re.DOTALL
)
_MARK = "\ue000{}\ue001"  # private characters, which Markdown leaves alone


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Set formulas aside, so that Markdown does not read their signs as its own."""
    formulas: list[str] = []

    def aside(match: re.Match[str]) -> str:
        block = match["block"]
        formula = convert(block or match["inline"], display="block" if block else "inline")
        # A window narrower than an equation scrolls that equation alone.
        wide = f'<span style="display:block;overflow-x:auto">{formula}</span>'
        formulas.append(wide if block else formula)
        return _MARK.format(len(formulas) - 1)

    parts = _CODE.split(markdown)
    # split() returns text, code, its fence, text, ...
    texts = [_FORMULA.sub(aside, part) if i % 3 == 0 else part for i, part in enumerate(parts)]
    page.meta["formulas"] = formulas
    return "".join(t for i, t in enumerate(texts) if i % 3 != 2)


def on_page_content(html: str, *, page: Any, **_: Any) -> str:
    """Put the formulas into the page."""
    for i, formula in enumerate(page.meta.get("formulas", [])):
        html = html.replace(_MARK.format(i), formula)
    return html
