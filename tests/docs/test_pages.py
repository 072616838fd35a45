"""What the documentation shows, run as its reader would run it, page by page in an empty folder."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mitsuba_endo.records.solution import load_solution

DOCS = Path(__file__).parents[2] / "docs"
_BLOCK = re.compile(
    r"^```(?P<language>\w+)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


def _blocks(page: str) -> list[re.Match[str]]:
    return list(_BLOCK.finditer((DOCS / page).read_text("utf-8")))


def _run(command: list[str], folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(DOCS.parent)}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


def _follow(page: str, folder: Path) -> None:
    """Write the files that a page gives, run its commands, and its Python as one program.

    What needs PyTorch is marked ``bash`` instead of ``sh``, and left out where there is none.
    """
    shells = {"sh", "bash"} if importlib.util.find_spec("torch") else {"sh"}
    program = ""
    for block in _blocks(page):
        if block["title"]:
            (folder / block["title"]).write_text(block["text"], "utf-8")
        elif block["language"] in shells:
            program = _execute(program, folder)
            _run(["bash", "-euc", block["text"]], folder)
        elif block["language"] == "python":
            program += block["text"] + "\n"
    _execute(program, folder)


def _execute(program: str, folder: Path) -> str:
    if program:
        _run([sys.executable, "-W", "error", "-c", program], folder)
    return ""


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize(
    "page",
    [
        "start.md",
        "refinement.md",
        "video.md",
        "tutorials/scene.md",
        "tutorials/projection_model.md",
        "tutorials/dataset.md",
    ],
)
def test_page_does_what_it_says(page: str, tmp_path: Path) -> None:
    """Oracle: every command ends with exit code 0, every assertion of the page holds."""
    _follow(page, tmp_path)


@pytest.mark.usefixtures("llvm")
def test_gray_code_page_finds_the_projector(tmp_path: Path) -> None:
    """Oracle: the scene's focal length, 300, within the per cent that the page promises."""
    _follow("tutorials/gray_code.md", tmp_path)
    focal = load_solution(tmp_path / "result").projector.focal.value
    assert focal == pytest.approx(300, rel=0.01)
