"""``patterns`` writes what ``decode-stack`` reads back; bad stacks end with one sentence."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.records.correspondence import load_map
from tests.cli.inputs import run

SIZE = ("--width", 61, "--height", 44)


@pytest.fixture
def projected(tmp_path: Path) -> Path:
    result = run("patterns", "--kind", "gray", "--inverse", *SIZE, "--out", tmp_path / "stack")
    assert result.exit_code == 0, result.stderr
    return tmp_path / "stack"


def _decode(folder: Path, *options: object, kind: str = "gray"):
    """Decode a stack of the folder; extra options come last."""
    out = folder.parent / "map.exr"
    return run("decode-stack", folder, "--pattern", kind, *SIZE, "--out", out, *options)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("gray", ("--inverse",)),
        ("gray", ("--no-reference",)),
        ("phase", ("--periods", "70,22,9", "--steps", 5)),
        ("gray+phase", ("--stripe", 4)),
    ],
)
def test_projected_images_decode_to_their_own_pixels(kind, options, tmp_path: Path):
    """Oracle: pixel (x, y) of a projected image is pattern pixel (x, y)."""
    folder = tmp_path / "stack"
    made = run("patterns", "--kind", kind, *SIZE, "--out", folder, *options, "--json")
    assert made.exit_code == 0, made.stderr
    result = _decode(folder, *options, "--json", kind=kind)
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary["images"] == len(json.loads(made.stdout)["images"])
    found = load_map(tmp_path / "map.exr")
    assert summary["decoded"] == pytest.approx(found.valid.mean())
    assert found.valid.mean() > 0.99
    y, x = np.mgrid[:44, :61]
    error = np.abs(found.q - np.stack([x, y], -1))[found.valid]
    assert error.max() < (0.01 if kind == "gray" else 0.1)


def test_the_printed_command_fits(projected: Path):
    """Oracle: the command that ``patterns`` prints, run as it stands."""
    command = json.loads(
        run("patterns", "--kind", "gray", *SIZE, "--out", projected, "--json").stdout
    )["decode"]
    words = command.replace("FOLDER", str(projected)).replace(
        "map.exr", str(projected.parent / "map.exr")
    )
    result = run(*words.split()[1:])
    assert result.exit_code == 0, result.stderr


def test_colour_and_16_bits(projected: Path):
    """Oracle: the same map from the images as green 12-bit pictures in 16-bit files."""
    assert _decode(projected, "--inverse").exit_code == 0
    expected = load_map(projected.parent / "map.exr").q
    for path in projected.glob("*.png"):
        gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).astype(np.uint16) * 12 + 200
        cv2.imwrite(str(path), np.stack([0 * gray, gray, gray // 3], -1))
    result = _decode(projected, "--inverse")
    assert result.exit_code == 0, result.stderr
    np.testing.assert_array_equal(load_map(projected.parent / "map.exr").q, expected)


def test_gamma(tmp_path: Path):
    """Oracle: own pixels, from images encoded as a photograph's are; unnoticed it must hurt."""
    options, folder = ("--periods", "70,22,9", "--steps", 3), tmp_path / "stack"
    assert run("patterns", "--kind", "phase", *SIZE, "--out", folder, *options).exit_code == 0
    for path in folder.glob("*.png"):
        light = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) / 255
        cv2.imwrite(str(path), np.rint(65535 * light ** (1 / 2.2)).astype(np.uint16))
    y, x = np.mgrid[:44, :61]
    errors = []
    for gamma in (2.2, 1.0):
        result = _decode(folder, *options, "--gamma", gamma, kind="phase")
        assert result.exit_code == 0, result.stderr
        found = load_map(tmp_path / "map.exr")
        errors.append(np.abs(found.q - np.stack([x, y], -1))[found.valid].max())
    assert errors[0] < 0.1 < errors[1]


def _fail(result, code: int, *expected: str) -> None:
    assert result.exit_code == code, result.stderr
    assert len(result.stderr.splitlines()) == 1
    for part in expected:
        assert part in result.stderr


def test_missing_image(projected: Path):
    """Oracle: the name of the file that was deleted."""
    next(projected.glob("*x_gray03_inverse*")).unlink()
    _fail(_decode(projected, "--inverse"), 2, "x_gray03_inverse is missing")
    assert not (projected.parent / "map.exr").exists()


def test_missing_image_without_names(projected: Path):
    """Oracle: the counts; names that say nothing cannot tell which image it is."""
    for i, path in enumerate(sorted(projected.glob("*.png"))):
        path.rename(projected / f"IMG_{i}.png")
    assert _decode(projected, "--inverse").exit_code == 0  # IMG_10 comes after IMG_9
    (projected / "IMG_7.png").unlink()
    _fail(_decode(projected, "--inverse"), 2, "25 images, but such patterns have 24, 26")


def test_swapped_images(projected: Path):
    """Oracle: the two files that were exchanged on the command line."""
    paths = sorted(projected.glob("*.png"))
    paths[3], paths[5] = paths[5], paths[3]
    out = projected.parent / "map.exr"
    result = run(
        "decode-stack", *paths, "--pattern", "gray", *SIZE, "--inverse", "--out", out
    )  # fmt: skip
    _fail(result, 2, "x_gray05_inverse is expected", paths[3].name)


def test_images_of_another_size(projected: Path):
    """Oracle: the file that was cropped."""
    path = next(projected.glob("*y_gray02.png"))
    cv2.imwrite(str(path), cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[:, :50])
    _fail(_decode(projected, "--inverse"), 2, path.name, "is 50 x 44 pixels")


def test_damaged_and_missing_files(projected: Path):
    """Oracle: the file that was damaged; a path that does not exist."""
    path = next(projected.glob("*y_gray02.png"))
    path.write_bytes(b"not an image")
    _fail(_decode(projected, "--inverse"), 2, path.name, "not a readable image")
    _fail(_decode(projected / "none"), 2, "no such image")


def test_dark_images_end_with_code_3(projected: Path):
    """Oracle: the exit code for images without a pattern; nothing is written."""
    for path in projected.glob("*.png"):
        cv2.imwrite(str(path), np.full((44, 61), 9, np.uint8))
    _fail(_decode(projected, "--inverse"), 3, "no pixel changes")
    assert not (projected.parent / "map.exr").exists()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--out", "map.png"), ".exr or .npz"),
        (("--kind", "grey"), "grey"),
        (("--periods", "a,b"), "a,b"),
        (("--steps", 4), "steps"),
        (("--width", 1), "width"),
    ],
)
def test_bad_options(options, expected: str, projected: Path):
    """Oracle: the option that is wrong is named."""
    _fail(_decode(projected, "--inverse", *options), 2, expected)
