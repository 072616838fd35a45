"""The command ``calibrate`` with camera files of other programs, as their owners ran it."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mitsuba_endo.cli.main import app

FIELD = Path(__file__).parents[3] / "shared" / "field"

pytestmark = [
    pytest.mark.usefixtures("llvm"),
    pytest.mark.skipif(not FIELD.is_dir(), reason="the inputs of the field are not here"),
]


def run(name: str, rig: str, out: Path):
    folder = FIELD / name
    arguments = [str(folder / "map.exr"), "--rig", str(folder / rig), "--out", str(out)]
    return CliRunner().invoke(app, ["calibrate", *arguments])


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("01_distortion_model_equidistant", "opencv_fisheye, as it says (equidistant); fx 105"),
        ("02_distortion_name_dropped", "coefficients k1 -0.25, k2 0.05, p1 0, p2 0, k3 0."),
    ],
)
def test_the_lens_of_a_camera_file_counts(tmp_path, name, note):
    """Oracle: the true focal length, 300 pattern pixels; without the lens it was 230 and 414."""
    result = run(name, "asked.yaml", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert note in re.sub(r"\s+", " ", result.output)
    focal = json.loads((tmp_path / "out" / "solution.json").read_text())["projector"]["focal"]
    assert focal["value"] == pytest.approx(300, abs=0.05)  # 0.02 %, of a map without noise
    assert focal["status"] == "measured"
