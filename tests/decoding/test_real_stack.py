"""Photographs of stacks as other people made them; skipped where they are not at hand."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.records.correspondence import load_map
from tests.cli.inputs import run

SHARED = Path(__file__).parents[3] / "shared"
KAMINO = SHARED / "real" / "kamino"
FIELD = SHARED / "field"


@pytest.mark.skipif(not KAMINO.is_dir(), reason="the captures are not at hand")
def test_kamino_as_shot(tmp_path: Path):
    """White and black last, inverses beside. Oracle: other authors' map, every third pixel."""
    out = tmp_path / "map.exr"
    size = ("--width", 1024, "--height", 768)
    result = run("decode-stack", KAMINO / "photographs", *size, "--out", out, "--json")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary["decoded"] > 0.7 * summary["lit"]
    words = ["columns-first", "gray-code", "coarse-first", "pattern-first"]
    assert (summary["pattern"], summary["convention"]) == ("gray", words)
    assert summary["order"][:4] == [40, 41, 0, 1]
    decoded = load_map(out)
    theirs = np.load(KAMINO / "capture_0_small.npz")["map"]
    apart = np.abs(decoded.q[::3, ::3] - theirs)
    both = np.isfinite(apart).all(-1)
    assert both.sum() > 0.95 * np.isfinite(theirs[..., 0]).sum()
    assert (np.median(apart[both], axis=0) < 0.06).all()
    assert decoded.weight is not None
    assert decoded.weight.max() == pytest.approx(1)


@pytest.mark.skipif(not FIELD.is_dir(), reason="the inputs are not at hand")
def test_sine_instead_of_cosine(tmp_path: Path):
    """Oracle: the map beside them; taken for a cosine, it is 4 pixels lower, a quarter period."""
    folder = FIELD / "03_gray_phase_sine_offset"
    out = tmp_path / "m.exr"
    size = ("--width", 480, "--height", 384)
    for stated in (("--pattern", "gray+phase", "--stripe", 4), ()):
        result = run("decode-stack", folder / "stack", *size, *stated, "--out", out, "--json")
        assert result.exit_code == 0, result.stderr
        assert "offset=0.75" in json.loads(result.stdout)["convention"]
        apart = load_map(out).q - load_map(folder / "map.exr").q
        both = np.isfinite(apart).all(-1)
        assert both.mean() > 0.9
        np.testing.assert_allclose(np.median(apart[both], axis=0), 0, atol=0.02)


@pytest.mark.skipif(not FIELD.is_dir(), reason="the inputs are not at hand")
def test_rows_first(tmp_path: Path):
    """Oracle: the input's README; x grows to the right in the picture, and y downwards."""
    out = tmp_path / "m.exr"
    options = ("--pattern", "gray", "--width", 480, "--height", 384, "--out", out)
    result = run("decode-stack", FIELD / "07_gray_rows_first" / "stack", *options)
    assert result.exit_code == 0, result.stderr
    assert "rows-first" in result.stdout
    q = load_map(out).q
    assert np.nanmedian(np.diff(q[..., 0], axis=1)) > 0.5
    assert np.nanmedian(np.diff(q[..., 1], axis=0)) > 0.5
    assert np.nanmax(q[..., 0]) > 340


MEASURED = """
import json, resource, sys
from pathlib import Path
from mitsuba_endo.decoding.stack import decode_stack
from mitsuba_endo.decoding.stack_files import StackFiles, stack_paths
from mitsuba_endo.decoding.stack_reading import StackRequest, find_reading
stack = StackFiles(stack_paths([sys.argv[1]]))
reading = find_reading(stack, StackRequest(width=1024, height=768, kind="gray"))
decoded = decode_stack(stack, reading.plan, order=reading.order)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([peak, float(decoded.decoded.mean()), list(reading.words)]))
"""


def _write(folder: Path, width: int, height: int) -> None:
    """Write the photographs of a screen, seen a little bent, rows first and white last."""
    plan = StackPlan.make("gray", 1024, 768, inverse=True)
    y, x = np.mgrid[:height, :width].astype(np.float32)
    at = (x * (1000 / width) + 10 + 2e-5 * y, y * (740 / height) + 12 + 2e-5 * x)
    images = dict(zip(plan.labels(), patterns(plan), strict=True))
    labels = [*plan.axis_labels("y"), *plan.axis_labels("x"), "white", "black"]
    folder.mkdir()
    for k, label in enumerate(labels):
        light = np.uint8(20 + 0.7 * images[label])
        seen = cv2.remap(light, *at, interpolation=cv2.INTER_LINEAR)
        cv2.imwrite(str(folder / f"IMG_{k:03d}.png"), seen, [cv2.IMWRITE_PNG_COMPRESSION, 1])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the unit of the peak is Linux's")
def test_memory_of_42_photographs_of_16_megapixels(tmp_path: Path):
    """Oracle: the operating system's count; all photographs alone are 0.7 GB, as floats 2.7 GB."""
    _write(tmp_path / "stack", 4672, 3504)
    command = [sys.executable, "-c", MEASURED, str(tmp_path / "stack")]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    peak, decoded, words = json.loads(result.stdout)
    assert peak < 1_500_000, f"{peak / 1e6:.2f} GB"
    assert decoded > 0.95
    assert words[0] == "rows-first"


def test_strips_and_reading_again_change_nothing(tmp_path: Path, monkeypatch):
    """Oracle: the same stack in memory and in one strip."""
    from mitsuba_endo.decoding import row_chunks
    from mitsuba_endo.decoding.stack import decode_stack
    from mitsuba_endo.decoding.stack_files import StackFiles, stack_paths
    from mitsuba_endo.decoding.stack_reading import StackRequest, find_reading

    _write(tmp_path / "stack", 300, 210)
    paths = stack_paths([tmp_path / "stack"])
    request = StackRequest(width=1024, height=768, kind="gray")
    whole = StackFiles(paths)
    reading = find_reading(whole, request)
    expected = decode_stack(whole, reading.plan, order=reading.order)
    monkeypatch.setattr(row_chunks, "CHUNK_VALUES", 22 * 300 * 50)
    again = StackFiles(paths, memory=22 * 300 * 60)
    assert find_reading(again, request) == reading
    decoded = decode_stack(again, reading.plan, order=reading.order)
    np.testing.assert_array_equal(decoded.q, expected.q)
    np.testing.assert_array_equal(decoded.variance, expected.variance)
    np.testing.assert_array_equal(decoded.lit, expected.lit)
