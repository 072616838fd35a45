"""Reference of the Mitsuba plugins, made from their docstrings' parameter tables."""

import ast
import re
import textwrap
from pathlib import Path
from typing import Any

PLUGINS = Path(__file__).parents[2] / "plugins"
_PLACE = "<!-- plugins -->"
_TITLE = re.compile(r"^(?P<what>.+?) \(:monosp:`(?P<name>\w+)`\)")
_SIMPLE_TABLE = re.compile(r"^=+ +=+\n(?P<rows>.+?)^=+ +=+$", re.DOTALL | re.MULTILINE)
_ROLE = re.compile(r":(?:\w+:)?(?P<role>\w+):`~?(?P<text>[^`]+)`")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the reference where a page asks for it."""
    return markdown.replace(_PLACE, reference()) if _PLACE in markdown else markdown


def reference() -> str:
    """Return one section a plugin, as Markdown.

    Raises:
        ValueError: a plugin's documentation lacks its title or its table.
    """
    return "\n\n".join(section(text) for text in docstrings())


def docstrings() -> list[str]:
    """Return the docstrings of the plugin classes, read without importing Mitsuba."""
    found = []
    for path in sorted(PLUGINS.glob("*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            text = ast.get_docstring(node) if isinstance(node, ast.ClassDef) else None
            if text and ":monosp:" in text:
                found.append(text)
    return found


def section(docstring: str) -> str:
    """Return a plugin's title, table, text and examples as Markdown."""
    title = _TITLE.match(docstring)
    if title is None or ".. pluginparameters::" not in docstring:
        raise ValueError(f"not a plugin's documentation: {docstring[:60]!r}")
    _, rest = docstring.split(".. pluginparameters::", 1)
    body = re.search(r"^\S", rest, re.MULTILINE)
    end = body.start() if body else len(rest)
    text, _, examples = rest[end:].partition(".. tabs::")
    head = [f"## {title['name']}", title["what"] + "."]
    parts = [*head, _table(rest[:end]), _plain(text.strip()), *_examples(examples)]
    return "\n\n".join(parts)


def _table(source: str) -> str:
    rows = []
    for entry in re.split(r"^\s*\* - ", source, flags=re.MULTILINE)[1:]:
        cells = [
            _plain(" ".join(cell.split()))
            for cell in re.split(r"^\s+-(?:\s|$)", entry, flags=re.MULTILINE)
        ]
        rows.append(cells + [""] * (4 - len(cells)))
    head = ["Parameter", "Type", "Meaning", "Flags"]
    lines = [head, ["---"] * 4, *([f"`{c[0]}`", c[1], c[2], c[3]] for c in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _examples(source: str) -> list[str]:
    blocks = re.split(r"^\s*\.\. code-tab:: (\w+)\n", source, flags=re.MULTILINE)
    pairs = zip(blocks[1::2], blocks[2::2], strict=True)
    return [f"```{language}\n{textwrap.dedent(code).strip()}\n```" for language, code in pairs]


def _plain(text: str) -> str:
    """Return reStructuredText's inline marks as Markdown's."""
    text = _SIMPLE_TABLE.sub(_definitions, text)
    text = re.sub(r"\|(\w+)\|", r"*\1*", text)
    text = _ROLE.sub(lambda m: f"`{m['text']}`", text)
    text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text)
    return text.replace("``", "`")


def _definitions(table: re.Match[str]) -> str:
    """Return a two-column table of reStructuredText as a list of names and meanings."""
    joined = re.sub(r"\n +", " ", table["rows"].strip())
    pairs = [re.split(r"\s+", line, maxsplit=1) for line in joined.splitlines()]
    return "\n".join(f"- `{name}`: {meaning}" for name, meaning in pairs)
