"""Images as cameras and other programs store them: turned, of several pages, as floats."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from mitsuba_endo.decoding.image_files import open_image, read_frames, read_image
from mitsuba_endo.decoding.stack_files import StackFiles, stack_paths
from mitsuba_endo.decoding.video_files import bits
from mitsuba_endo.errors import InputError

PICTURE = np.random.default_rng(0).integers(0, 256, (20, 32), np.uint8)
SMOOTH = cv2.resize(PICTURE[:5, :8], (64, 40), interpolation=cv2.INTER_CUBIC)
SUFFIXES = {"JPEG": ".jpg", "PNG": ".png", "TIFF": ".tif", "WEBP": ".webp"}


def _save(path: Path, image: np.ndarray, turn: int, kind: str) -> None:
    exif = Image.Exif()
    exif[274] = turn  # the tag of the orientation
    options = {"quality": 95} if kind == "JPEG" else {"lossless": True} if kind == "WEBP" else {}
    Image.fromarray(image).convert("RGB").save(path, kind, exif=exif, **options)


@pytest.mark.parametrize("kind", SUFFIXES)
@pytest.mark.parametrize("turn", range(1, 9))
def test_orientation_is_followed_in_every_format(tmp_path: Path, kind: str, turn: int):
    """Oracle: Pillow, which turns as the tag says; JPEG may differ by 1."""
    path = tmp_path / f"a{SUFFIXES[kind]}"
    _save(path, SMOOTH, turn, kind)
    stored = open_image(path)
    expected = np.array(ImageOps.exif_transpose(Image.open(path)))
    np.testing.assert_allclose(stored.pixels.astype(int), expected[..., ::-1].astype(int), atol=1)
    assert bool(stored.note) == (turn != 1)
    assert ("orientation tag" in stored.note) == (turn != 1)
    (frame,) = read_frames([path])
    assert frame.note == stored.note


def test_damaged_tags_are_passed_over(tmp_path: Path):
    """Oracle: the contract: an image without a readable tag is as it is."""
    path = tmp_path / "a.jpg"
    _save(path, SMOOTH, 6, "JPEG")
    data = path.read_bytes()
    at = data.index(b"Exif\0\0")
    for cut in (b"Exif\0\0II*\0\xff\xff\xff\xff", b"Exif\0\0II*\0\x08\0\0\0\xff\xff"):
        path.write_bytes(data[:at] + cut + data[at + len(cut) :])
        assert open_image(path).note == ""


def test_pages_are_images(tmp_path: Path):
    """Oracle: the pages written; a smaller copy for previews is none."""
    pages = [Image.fromarray(np.roll(PICTURE, k)) for k in range(3)]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    frames = list(read_frames([tmp_path / "a.tif"]))
    assert [frame.name for frame in frames] == ["a_00000", "a_00001", "a_00002"]
    for k, frame in enumerate(frames):
        np.testing.assert_array_equal(np.rint(frame.image[..., 0] * 255), np.roll(PICTURE, k))
    with pytest.raises(InputError, match="holds 3 images"):
        read_image(tmp_path / "a.tif")
    stack = StackFiles(stack_paths([tmp_path / "a.tif"]))
    assert len(stack) == 3
    np.testing.assert_allclose(stack.rows([2], 0, 20).images[0] * 255, np.roll(PICTURE, 2))
    preview = pages[1].resize((16, 10))
    preview.encoderinfo = {"tiffinfo": {254: 1}}
    pages[0].save(tmp_path / "b.tif", save_all=True, append_images=[preview])
    np.testing.assert_array_equal(read_image(tmp_path / "b.tif")[..., 0], PICTURE)


@pytest.mark.parametrize("kind", ["PNG", "WEBP"])
def test_animations_are_refused(tmp_path: Path, kind: str):
    """Oracle: the number of images written."""
    path = tmp_path / f"a{SUFFIXES[kind]}"
    pages = [Image.fromarray(np.roll(PICTURE, k)).convert("RGB") for k in range(3)]
    pages[0].save(path, save_all=True, append_images=pages[1:], lossless=True)
    with pytest.raises(InputError, match="holds 3 images"):
        list(read_frames([path]))


def test_floats(tmp_path: Path):
    """Oracle: the brightness written; anything but 0 to 1 says nothing of full scale."""
    light = PICTURE.astype(np.float32) / 255
    cv2.imwrite(str(tmp_path / "a.tif"), light)
    np.testing.assert_allclose(read_image(tmp_path / "a.tif")[..., 0] / 65535, light, atol=1e-5)
    for wrong, words in (
        (light * 200, "floats from 0 to 200"),
        (light * np.nan, "floats from nan"),
    ):
        cv2.imwrite(str(tmp_path / "a.tif"), wrong)
        with pytest.raises(InputError, match=words):
            read_image(tmp_path / "a.tif")
    cv2.imwrite(str(tmp_path / "a.tif"), PICTURE.astype(np.int32))
    with pytest.raises(InputError, match="is int32"):
        read_image(tmp_path / "a.tif")


def test_mosaic_is_refused(tmp_path: Path):
    """Oracle: TIFF/EP's number of a colour filter array."""
    Image.fromarray(PICTURE).save(tmp_path / "a.tif", tiffinfo={262: 32803})
    data = (tmp_path / "a.tif").read_bytes()
    entry = data.index(b"\x06\x01\x03\0\x01\0\0\0")
    (tmp_path / "a.tif").write_bytes(data[: entry + 8] + b"\x23\x80" + data[entry + 10 :])
    with pytest.raises(InputError, match="Bayer"):
        read_image(tmp_path / "a.tif")


def test_hidden_files_are_passed_over(tmp_path: Path):
    """Oracle: by hand: macOS writes a file of its own beside each on other systems' disks."""
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"{k}.png"), PICTURE)
        (tmp_path / f"._{k}.png").write_bytes(b"\0\5\x16\7")
    assert len(list(read_frames([tmp_path]))) == len(stack_paths([tmp_path])) == 3


def _video(path: Path, depth: int) -> None:
    codec = cv2.VideoWriter.fourcc(*"FFV1")
    kind = [cv2.VIDEOWRITER_PROP_DEPTH, depth, cv2.VIDEOWRITER_PROP_IS_COLOR, 0]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, codec, 10, SMOOTH.shape[::-1], kind)
    if not writer.isOpened():
        pytest.skip("OpenCV writes no such video here")
    for _ in range(2):
        writer.write(SMOOTH if depth == cv2.CV_8U else SMOOTH.astype(np.uint16) * 257)
    writer.release()


@pytest.mark.parametrize(("depth", "words"), [(cv2.CV_8U, ""), (cv2.CV_16U, "has 16 bits")])
def test_deep_video_is_read_with_a_warning(tmp_path: Path, depth: int, words: str):
    """Oracle: the lossless video's own brightness."""
    _video(tmp_path / "a.mkv", depth)
    frames = list(read_frames([tmp_path / "a.mkv"]))
    assert len(frames) == 2
    for frame in frames:
        assert words in frame.note
        assert bool(words) == bool(frame.note)
        np.testing.assert_allclose(frame.image[..., 0] * 255, SMOOTH, atol=1)


def test_bits_of_video_formats():
    """Oracle: FFmpeg's table of tags (libavcodec/raw.c)."""
    for tag, expected in {
        b"I420": 8, b"Y3\x0b\x0a": 10, b"\x0a\x0b3Y": 10, b"Y1\0\x10": 16, b"P010": 10, bytes(4): 8,
    }.items():  # fmt: skip
        assert bits(tag) == expected


def test_turned_video(tmp_path: Path):
    """Oracle: the matrix of the track by hand, which players follow."""
    path = tmp_path / "a.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10, SMOOTH.shape[::-1])
    if not writer.isOpened():
        pytest.skip("OpenCV writes no such video here")
    for _ in range(3):
        writer.write(np.dstack([SMOOTH] * 3))
    writer.release()
    straight = next(read_frames([path]))
    data = path.read_bytes()
    one, minus = (0x10000).to_bytes(4, "big"), (0xFFFF0000).to_bytes(4, "big")
    zero, unit = bytes(4), (0x40000000).to_bytes(4, "big")
    upright = one + zero * 3 + one + zero * 3 + unit
    at = data.index(upright, data.index(b"tkhd"))
    turned = minus + zero * 3 + minus + zero * 3 + unit
    path.write_bytes(data[:at] + turned + data[at + len(turned) :])
    frame = next(read_frames([path]))
    assert straight.note == ""
    assert "turned by 180 degrees" in frame.note
    np.testing.assert_array_equal(frame.image, straight.image[::-1, ::-1])


FIELD = Path(__file__).parents[3] / "shared" / "field" / "17_exif_video_rotation"


@pytest.mark.skipif(not FIELD.is_dir(), reason=f"{FIELD} is absent")
@pytest.mark.parametrize("name", ["exif3.jpg", "exif6.jpg", "v_rot180.mp4"])
def test_field(name: str):
    """Oracle: OpenCV's readers, which turn both; the tag is warned of."""
    frame = next(read_frames([FIELD / name]))
    if name.endswith(".jpg"):
        expected = cv2.imread(str(FIELD / name))
    else:
        _, expected = cv2.VideoCapture(str(FIELD / name)).read()
    assert expected is not None
    np.testing.assert_array_equal(np.rint(frame.image * 255), expected)
    assert "orientation tag" in frame.note
