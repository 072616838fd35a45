"""``decode`` with the network that comes with the package, on images whose truth is known."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy.ndimage import gaussian_filter

from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.show.grid_picture import LEGEND
from tests.cli.inputs import run
from tests.decoding.grid_views import CAMERA, HEIGHT, SIZE, WIDTH, photo, view

PERIOD = CodedGrid().period
FALSE = 0.01
"""Share of the pixels that an image without this pattern may get."""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    data = {
        "camera": Camera.from_model(CAMERA).model_dump(),
        "projector": {"law": "direction_cosine", "width": SIZE[0], "height": SIZE[1]},
    }
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


def _decode(rig: Path, *images: object, options: tuple[object, ...] = ()):
    """Decode into the folder ``maps`` beside the rig."""
    return run("decode", *images, "--rig", rig, "--out", rig.parent / "maps", *options)


def _image(rig: Path, image: np.ndarray, name: str = "frame.png") -> Path:
    path = rig.parent / name
    assert cv2.imwrite(str(path), image)
    return path


def _check(path: Path, q: np.ndarray, coverage: float = 0.9) -> None:
    """Compare a map with the exact coordinates, within the bounds that the decoder promises."""
    found = load_map(path).q
    both = np.isfinite(found[..., 0]) & np.isfinite(q[..., 0])
    error = np.abs(found - q)[both] / PERIOD
    assert both.sum() > coverage * np.isfinite(q[..., 0]).sum()
    assert np.median(error) < 0.03
    assert (error.max(1) > 0.5).mean() < 0.002


def test_a_map_with_confidence_and_picture(llvm, rig: Path):
    """Oracle: the view's exact coordinates; the files and counts that the summary promises."""
    q = view("sheet")
    result = _decode(rig, _image(rig, photo(q)), options=("--json",))
    assert result.exit_code == 0, result.stderr
    maps = rig.parent / "maps"
    _check(maps / "frame.exr", q)
    (summary,) = json.loads(result.stdout)["frames"]
    decoded = load_map(maps / "frame.exr").valid
    assert summary["coverage"] == pytest.approx(decoded.mean())
    assert 0.9 * summary["nodes"] < summary["placed"] <= summary["nodes"]
    confidence = read_exr(maps / "frame.exr")["confidence"]
    np.testing.assert_array_equal(confidence > 0, decoded)
    picture = cv2.imread(str(maps / "frame_graph.png"))
    assert picture is not None
    shown = picture.shape[0] - LEGEND
    assert picture.shape[1] / shown == pytest.approx(WIDTH / HEIGHT)
    assert len(np.unique(picture[shown:].reshape(-1, 3), axis=0)) > 5  # lines in colours, words


def test_one_line_a_frame(llvm, rig: Path):
    """Oracle: the numbers that a user is promised in the summary."""
    result = _decode(rig, _image(rig, photo(view("sheet"))))
    line = " ".join(result.stdout.split())  # the terminal breaks it
    assert line.count("frame:") == 1
    for word in ("nodes identified", "rejected", "% of the pixels decoded", "% of them refined"):
        assert word in line


def test_upside_down(llvm, rig: Path):
    """Oracle: the exact coordinates turned with the image."""
    q = view("sheet")
    assert _decode(rig, _image(rig, photo(q)[::-1, ::-1])).exit_code == 0
    _check(rig.parent / "maps" / "frame.exr", q[::-1, ::-1])


def test_colour_and_16_bits(llvm, rig: Path):
    """Oracle: the exact coordinates from a green 12-bit image in a 16-bit file."""
    q = view("sheet")
    gray = photo(q).astype(np.uint16) * 14
    _image(rig, np.stack([gray // 9, gray, gray // 5], -1))
    assert _decode(rig, rig.parent / "frame.png").exit_code == 0
    _check(rig.parent / "maps" / "frame.exr", q)


def test_another_pattern(llvm, rig: Path):
    """Oracle: exact coordinates of a pattern that only ``--pattern`` names."""
    q = view("sheet")
    path = _image(rig, photo(q, CodedGrid(seed=3)))
    assert _decode(rig, path, options=("--pattern", "pattern:coded?seed=3")).exit_code == 0
    _check(rig.parent / "maps" / "frame.exr", q)


def test_a_video_and_a_folder(llvm, rig: Path):
    """Oracle: exact coordinates of each frame of a video in a folder; a blank one has no map."""
    folder = rig.parent / "frames"
    folder.mkdir()
    views = [view("sheet"), view("colon")]
    kind = cv2.VideoWriter.fourcc(*"MJPG")
    video = cv2.VideoWriter(str(folder / "clip.avi"), kind, 10, (WIDTH, HEIGHT))
    for image in [*(photo(q) for q in views), np.zeros((HEIGHT, WIDTH), np.uint8)]:
        video.write(np.repeat(image[..., None], 3, -1))
    video.release()
    result = _decode(rig, folder)
    assert result.exit_code == 1, result.stderr
    maps = rig.parent / "maps"
    _check(maps / "clip_00000.exr", views[0])
    assert load_map(maps / "clip_00001.exr").valid.mean() > 0.4
    assert not (maps / "clip_00002.exr").exists()
    assert "clip_00002: nothing decoded: the image is dark" in result.stdout


def _fails(result, code: int, *expected: str) -> None:
    assert result.exit_code == code, result.stderr
    assert len(result.stderr.splitlines()) == 1
    for part in expected:
        assert part in result.stderr


def _tissue() -> np.ndarray:
    rng = np.random.default_rng(1)
    layers = [gaussian_filter(rng.standard_normal((HEIGHT, WIDTH)), s) * s for s in (1, 3, 9, 30)]
    image = np.sum(layers, 0)
    return np.interp(image, (image.min(), image.max()), (20, 240)).astype(np.uint8)


class Plain(CodedGrid):
    """The grid without steps."""

    @property
    def code(self) -> np.ndarray:
        return np.zeros((self.rows, self.columns), np.int8)


def _stripes(period: float, tilt: float) -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.rint(120 + 110 * np.cos(2 * np.pi * (x + tilt * y) / period)).astype(np.uint8)


FALSE_IMAGES = {
    "black": lambda: np.zeros((HEIGHT, WIDTH), np.uint8),
    "saturated": lambda: np.full((HEIGHT, WIDTH), 255, np.uint8),
    "noise": lambda: np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8),
    "tissue": _tissue,
    "stripes": lambda: _stripes(10.0, 0.1),
    "crossed stripes": lambda: np.maximum(_stripes(9.0, 0.0), _stripes(11.0, 9.0)),
    "chequers": lambda: np.kron(np.indices((37, 50)).sum(0) % 2 * 200, np.ones((8, 8))).astype(
        np.uint8
    ),
    "another code": lambda: photo(view("sheet"), CodedGrid(seed=5)),
    "another code on folds": lambda: photo(view("colon"), CodedGrid(seed=6)),
    "mirrored": lambda: photo(view("sheet"))[:, ::-1],
    "mirrored vertically": lambda: photo(view("colon"))[::-1],
    "no code": lambda: photo(view("sheet"), Plain()),
}


@pytest.mark.parametrize("name", FALSE_IMAGES)
def test_false_images_end_with_code_3(llvm, name: str, rig: Path):
    """Oracle: none of these shows the pattern; nothing is written, and the reason is told."""
    _fails(_decode(rig, _image(rig, FALSE_IMAGES[name]())), 3, "frame: ")
    assert not (rig.parent / "maps").exists()


def test_the_reason(llvm, rig: Path):
    """Oracle: what was done to the image."""
    for name, reason in {"black": "dark", "saturated": "saturated", "another code": "code"}.items():
        _fails(_decode(rig, _image(rig, FALSE_IMAGES[name]())), 3, reason)


def test_wrong_size_and_wrong_options(llvm, rig: Path, tmp_path: Path):
    """Oracle: the file and the option that are wrong."""
    good = _image(rig, photo(view("sheet")))
    small = _image(rig, photo(view("sheet"))[:-4], "small.png")
    _fails(_decode(rig, small), 2, "small.png", f"{WIDTH} x {HEIGHT - 4} pixels")
    _fails(_decode(rig, good, small), 2, "small.png")
    _fails(_decode(rig, tmp_path / "none.png"), 2, "no such image")
    for pattern, expected in {
        "pattern:grid": "has no code",
        "coded": "cannot be read",
        "pattern:coded?sed=3": "sed",
        "pattern:coded?width=100": "100 x 384",
    }.items():
        _fails(_decode(rig, good, options=("--pattern", pattern)), 2, expected)
    _fails(_decode(rig, good, options=("--weights", rig)), 2, "not a decoder network")
    assert not (tmp_path / "maps").exists()


def test_refinement_is_the_default_and_can_be_left_out(llvm, rig: Path):
    """Oracle: the exact coordinates: refined ones are nearer, and alone have covariances."""
    q = view("sheet")
    errors = {}
    for name, options in (("refined", ()), ("plain", ("--no-refine",))):
        image = _image(rig, photo(q), f"{name}.png")
        result = run("decode", image, "--rig", rig, "--out", rig.parent / name, "--json", *options)
        assert result.exit_code == 0, result.stderr
        (summary,) = json.loads(result.stdout)["frames"]
        map_ = load_map(rig.parent / name / f"{name}.exr")
        assert (map_.covariance is not None) == (name == "refined")
        assert (summary["refined"] is not None) == (name == "refined")
        errors[name] = np.nanmedian(np.abs(map_.q - q))
    assert errors["refined"] < 0.6 * errors["plain"]
