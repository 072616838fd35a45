"""What goes into the installed package."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
MAPPED = {"mitsuba_endo.plugins", "mitsuba_endo.scenes"}
"""Folders at the top that are installed inside the package."""


def test_every_folder_of_modules_is_installed():
    """Oracle: the folders on disk. An install that is no link to the sources lacked whole rooms."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = {path.parent for path in (ROOT / "mitsuba_endo").rglob("*.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert set(listed) == names | MAPPED
    assert len(listed) == len(set(listed))
