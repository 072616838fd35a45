"""Reference of the commands, made from the program's own help."""

from typing import Any

import typer.main
from typer.core import TyperArgument, TyperGroup

from mitsuba_endo.cli.main import app

_PLACE = "<!-- commands -->"
_OF_ALL = {"quiet", "as_json", "debug"}
"""Options of every command; the page itself explains them."""


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the reference where a page asks for it."""
    return markdown.replace(_PLACE, reference()) if _PLACE in markdown else markdown


def reference() -> str:
    """Return one section a command, as Markdown."""
    group = typer.main.get_command(app)
    if not isinstance(group, TyperGroup):
        raise TypeError("the program has no commands")
    context = group.context_class(group, info_name="mitsuba-endo")
    return "\n\n".join(section(name, command, context) for name, command in group.commands.items())


def section(name: str, command: Any, parent: Any) -> str:
    """Return a command's purpose, usage and options."""
    context = command.context_class(command, info_name=name, parent=parent)
    usage = " ".join(["mitsuba-endo", name, *command.collect_usage_pieces(context)])
    rows = [_row(p) for p in command.params if p.name not in _OF_ALL]
    table = ["| Option | Meaning | Default |", "| --- | --- | --- |", *rows] if rows else []
    return f"## {name}\n\n{command.help}\n\n    {usage}\n\n" + "\n".join(table)


def _row(parameter: Any) -> str:
    if isinstance(parameter, TyperArgument):
        name = parameter.metavar or parameter.name.upper()
    else:
        name = ", ".join([*parameter.opts, *parameter.secondary_opts])
    help_text = " ".join((getattr(parameter, "help", None) or "").split()).replace("|", "\\|")
    default = parameter.default
    shown = "" if default is None or callable(default) or default in ([], ()) else f"`{default}`"
    return f"| `{name}` | {help_text} | {shown} |"
