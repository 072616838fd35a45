"""The example notebook, run in a kernel of its own."""

import base64
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebooks" / "endoscope.ipynb"


@pytest.mark.usefixtures("llvm")
# Kernel and event loop warn about their own sockets, not about the notebook.
@pytest.mark.filterwarnings("ignore")
def test_notebook_runs_and_shows_its_results(tmp_path: Path) -> None:
    """Oracle: no cell fails, the solution is shown as HTML with units, figures as PNG."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    code = [c.source for c in notebook.cells if c.cell_type == "code"]
    assert "from mitsuba_endo" not in "".join(code)  # the calls of `me` are enough
    assert sum(bool(c.get("outputs")) for c in notebook.cells) >= 5  # rendered as it is kept
    client = NotebookClient(notebook, timeout=300, kernel_name="python3")
    client.execute(cwd=str(tmp_path))
    shown = [o["data"] for c in notebook.cells for o in c.get("outputs", []) if "data" in o]
    pages = [d["text/html"] for d in shown if "text/html" in d]
    pictures = [base64.b64decode(d["image/png"]) for d in shown if "image/png" in d]
    assert len(pages) == 1
    assert "Focal length" in pages[0]
    assert "pattern px" in pages[0]
    assert len(pictures) == 2
    assert all(p.startswith(b"\x89PNG") and len(p) > 5000 for p in pictures)
