"""The script on the page "From Python" does what the page says, copied as it stands there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import yaml

from mitsuba_endo.records.correspondence import save_map
from tests.solve.views import look, projector_poses, relief_surface, steps

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "tutorials" / "python.md").read_text(encoding="utf-8")


def test_the_script_runs(tmp_path: Path) -> None:
    """Oracle: the files and lines that it promises, in under 20 lines of code."""
    (script,) = re.findall(r"```python\n(.*?)```", PAGE, re.S)
    assert len([line for line in script.splitlines() if line]) <= 20
    views = look(relief_surface(), steps(1), projector_poses(1))
    save_map(tmp_path / "map.exr", views.maps[0].q)
    rig = yaml.safe_dump(views.rig().model_dump(mode="json"))
    (tmp_path / "rig.yaml").write_text(rig, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, "MPLBACKEND": "Agg"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Focal length: " in done.stdout
    assert "Unit of every length: mm" in done.stdout
    assert "mm (95 %)" in done.stdout
    assert (tmp_path / "depth.png").stat().st_size > 1000
    assert (tmp_path / "result" / "report.html").is_file()


def test_the_names_on_the_page_exist() -> None:
    """Oracle: the package and its result."""
    import mitsuba_endo as me

    assert all(hasattr(me, name) for name in re.findall(r"`me\.(\w+)", PAGE))
    assert all(
        hasattr(me.Result, name) or name == "solution"
        for name in re.findall(r"`result\.(\w+)", PAGE)
    )
