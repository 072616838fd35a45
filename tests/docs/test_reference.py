"""The Python reference holds what README and pages name; the options they name exist."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer

import mitsuba_endo as me
from mitsuba_endo.cli.main import app
from scripts.docs.roles import on_page_content

ROOT = Path(__file__).parents[2]
TEXTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")),
         *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]  # fmt: skip
REFERENCE = ROOT / "docs" / "reference.md"
PROGRAM = re.compile(r"`?mitsuba-endo ([a-z-]+)((?:[^`|\n]|\\\n)*)")


def _found(name: str) -> Any:
    """Return the object of a full name."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found: Any = import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            found = getattr(found, part)
        return found
    raise AssertionError(name)


def _documented() -> list[Any]:
    names = re.findall(r"^::: (\S+)$", REFERENCE.read_text("utf-8"), re.M)
    return [_found(name) for name in names]


def test_every_public_name_is_documented():
    """Oracle: ``__all__``, and what is named ``me.NAME`` or by its full name."""
    documented = _documented()
    named = {f"mitsuba_endo.{name}" for name in me.__all__ if name != "__version__"}
    readme = TEXTS[0].read_text("utf-8")
    named |= {f"mitsuba_endo.{name}" for name in re.findall(r"\bme\.(\w+)", readme)}
    named |= set(re.findall(r"`(mitsuba_endo\.[\w.]+)(?:\(\))?`", readme))
    assert len(named) > 10
    for name in named:
        assert any(_found(name) is one for one in documented), name


@pytest.mark.parametrize("text", TEXTS, ids=lambda path: path.name)
def test_python_names_exist(text: Path):
    """Oracle: the package: ``me.NAME``, and what is asked of a ``result`` in code."""
    said = text.read_text("utf-8")
    for name in re.findall(r"\bme\.(\w+)", said):
        assert hasattr(me, name), name
    for code in re.findall(r"^```python\n(.*?)^```$", said, re.S | re.M):
        if "me.calibrate" not in code and "me.load" not in code:
            continue
        for name in re.findall(r"\bresult\.(\w+)", code):
            assert hasattr(me.Result, name) or name in ("calibration", "rig"), name


@pytest.mark.parametrize("text", TEXTS, ids=lambda path: path.name)
def test_options_exist(text: Path):
    """Oracle: the options of the command beside which each is named."""
    commands: Any = typer.main.get_command(app)
    for name, rest in PROGRAM.findall(text.read_text("utf-8").replace("\\\n", " ")):
        if name not in commands.commands:
            continue  # a sentence that goes on after the program's name
        known = {o for p in commands.commands[name].params for o in (*p.opts, *p.secondary_opts)}
        for option in re.findall(r"(?<![\w-])--[a-z-]+", rest):
            assert option in known | {"--help"}, f"{name} {option}"


def test_roles_become_names():
    """Oracle: by hand."""
    html = "see :class:<code>SurfaceEstimate</code> and :mod:<code>..records.rig</code>."
    assert on_page_content(html) == (
        "see <code>SurfaceEstimate</code> and <code>records.rig</code>."
    )
