"""Files that no library should be given: no file at all, too large, too deep, promising too much.

Oracle: the sentence, and that it comes at once; where memory is meant, that it is not taken.
"""

import io
import json
import os
import struct
import threading
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from mitsuba_endo.decoding.image_files import read_image
from mitsuba_endo.errors import InputError, shown
from mitsuba_endo.reading.file_storage import read_file_storage
from mitsuba_endo.reading.regular import IMAGE, MAP, SizeLimit, is_file, read_bytes, regular
from mitsuba_endo.reading.trees import read_json, read_yaml
from mitsuba_endo.reading.xml_guard import read_xml
from mitsuba_endo.records.correspondence import load_map, save_map
from mitsuba_endo.records.exr_files import read_exr, write_exr
from mitsuba_endo.records.rig import load_rig
from mitsuba_endo.records.solution import load_solution
from mitsuba_endo.records.surface import load_surface
from tests.cli.inputs import q

SECONDS = 5.0
READERS: dict[str, Callable[[Path], object]] = {
    "a.yaml": load_rig, "a.json": load_solution, "a.exr": load_map, "a.npz": load_map,
    "a.png": read_image, "a.ply": load_surface, "b.yaml": read_file_storage, "a.xml": read_xml,
}  # fmt: skip
"""One reader of every kind of file, by a name that it takes."""


def _within_seconds(read: Callable[[], object]) -> BaseException | None:
    """Return what a reader raises; fail if it does not end."""
    found: list[BaseException | None] = []

    def run() -> None:
        try:
            read()
            found.append(None)
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(SECONDS)
    assert found, "it waits"
    return found[0]


def _refused(read: Callable[[], object], *words: str) -> None:
    error = _within_seconds(read)
    assert isinstance(error, InputError), error
    for word in words:
        assert word in str(error)
    assert "\n" not in str(error)


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str):
    os.mkfifo(tmp_path / name)
    _refused(lambda: READERS[name](tmp_path / name), "is a pipe or a device")


@pytest.mark.parametrize("name", READERS)
def test_a_device_without_end_is_not_read(tmp_path: Path, name: str):
    (tmp_path / name).symlink_to("/dev/zero")
    _refused(lambda: READERS[name](tmp_path / name), "is a pipe or a device")


@pytest.mark.parametrize("name", READERS)
def test_a_large_sparse_file_is_refused(tmp_path: Path, name: str):
    with (tmp_path / name).open("wb") as file:
        file.truncate(1 << 40)
    _refused(lambda: READERS[name](tmp_path / name), "takes 1048576 MiB", "MITSUBA_ENDO_LIMIT_")


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("way", ["absent", "folder", "long name", "loop", "below a file"])
def test_what_is_no_file_is_told(tmp_path: Path, name: str, way: str):
    path = tmp_path / name
    if way == "folder":
        path.mkdir()
        (path / "solution.json").mkdir()
    elif way == "long name":
        path = tmp_path / f"{'n' * 300}{path.suffix}"
    elif way == "loop":
        path.symlink_to(path)
    elif way == "below a file":
        (tmp_path / "file").touch()
        path = tmp_path / "file" / name
    _refused(lambda: READERS[name](path))
    assert not is_file(path)


def test_a_limit_can_be_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle: the sentence's own advice, followed."""
    kind, path = SizeLimit("tested", "a test", 1), tmp_path / "a"
    path.write_bytes(bytes(2 << 20))
    with pytest.raises(InputError, match=r"MITSUBA_ENDO_LIMIT_TESTED=2 if it is right"):
        regular(path, kind)
    monkeypatch.setenv("MITSUBA_ENDO_LIMIT_TESTED", "2")
    assert regular(path, kind) == len(read_bytes(path, kind)) == 2 << 20
    monkeypatch.setenv("MITSUBA_ENDO_LIMIT_TESTED", "much")
    with pytest.raises(InputError, match="MITSUBA_ENDO_LIMIT_TESTED: is no number of MiB"):
        regular(path, kind)


YAML = {
    "alias bomb": "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
    .replace("*a0", "1"),
    "itself": "a: &a [*a]\n",
    "deep": "a: " + "[" * 5000 + "]" * 5000,
    "deep but sound": "a: " + "[" * 60 + "]" * 60,
    "long number": f"a: {'1' * 5000}\n",
    "hexadecimal": f"a: 0x{'f' * 9999}\n",
    "no date": "a: 2001-99-99\n",
    "no integer": "a: !!int x\n",
    "code": "a: !!python/object/apply:os.system ['false']\n",
    "no boolean": "a: !!bool x\n",
}  # fmt: skip


def test_a_key_that_stands_twice_is_refused_and_a_merged_one_is_not(tmp_path: Path):
    """YAML wants keys once; PyYAML takes the last. Oracle: the sentence, and PyYAML on merges."""
    path = tmp_path / "a.yaml"
    path.write_text("units: mm\nprojector:\n  width: 3\n  width: 4\n")
    with pytest.raises(InputError, match=r"a\.yaml: width: stands twice, again in line 4"):
        read_yaml(path)
    merged = "a: &a {x: 1, y: 2}\nb:\n  <<: *a\n  x: 3\nd: &d {<<: *a, x: 4}\ne: {<<: *d}\n"
    path.write_text(merged)
    assert read_yaml(path) == yaml.safe_load(merged)


@pytest.mark.parametrize("text", ['{"a": 1, "b": 2, "a": 1}', '{"c": [{"a": 1, "b": 2, "a": 3}]}'])
def test_a_name_that_stands_twice_in_json_is_refused(tmp_path: Path, text: str):
    """Python takes the last one. Oracle: the sentence of every reader of JSON."""
    path = tmp_path / "a.json"
    path.write_text(text)
    for read in (load_solution, load_rig, read_file_storage):
        with pytest.raises(InputError, match=r"a\.json: (a: |'a' )stands twice"):
            read(path)


@pytest.mark.parametrize("case", YAML)
def test_yaml(tmp_path: Path, case: str):
    (tmp_path / "a.yaml").write_text(YAML[case])
    _refused(lambda: read_yaml(tmp_path / "a.yaml"), "a.yaml")


JSON = {
    "deep": '{"a": ' + "[" * 100_000 + "]" * 100_000 + "}",
    "deep but sound": '{"a": ' + "[" * 60 + "]" * 60 + "}",
    "long number": '{"a": ' + "1" * 5000 + "}",
    "huge number": '{"a": 1e300}',
    "half a character": '{"a": "\\ud800"}',
    "array": "[1]",
}


@pytest.mark.parametrize("case", JSON)
def test_json(tmp_path: Path, case: str):
    (tmp_path / "a.json").write_text(JSON[case])
    _refused(lambda: read_json(tmp_path / "a.json"), "a.json")


XML = {
    "deep": "<a>" * 20_000 + "</a>" * 20_000,
    "entities": '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
    "encoding": '<?xml version="1.0" encoding="no-such"?><a/>',
    "cut": "<a><b>",
}


@pytest.mark.parametrize("case", XML)
def test_xml(tmp_path: Path, case: str):
    (tmp_path / "a.xml").write_text(XML[case])
    _refused(lambda: read_xml(tmp_path / "a.xml"), "is not valid XML")


NESTS = {
    "yaml": "%YAML:1.0\n---\na: " + "[" * 30_000 + "]" * 30_000,
    "json": '{"a": ' + "[" * 30_000 + "]" * 30_000 + "}",
    "xml": '<?xml version="1.0"?>\n<opencv_storage>' + "<a>" * 30_000 + "</a>" * 30_000
    + "</opencv_storage>",
}  # fmt: skip


@pytest.mark.parametrize("suffix", NESTS)
def test_a_camera_file_does_not_end_the_process_by_depth(tmp_path: Path, suffix: str):
    """OpenCV's own reader does, by a signal."""
    (tmp_path / f"cam.{suffix}").write_text(NESTS[suffix])
    _refused(lambda: read_file_storage(tmp_path / f"cam.{suffix}"), f"cam.{suffix}")


def _npz(path: Path, header: bytes, compression: int = zipfile.ZIP_DEFLATED) -> None:
    with zipfile.ZipFile(path, "w", compression) as file:
        file.writestr("map.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)


HEADERS = {
    "terabytes": b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999, 99999, 2)}\n",
    "below zero": b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 2, 2)}\n",
    "objects": b"{'descr': '|O', 'fortran_order': False, 'shape': (3,)}\n",
    "structure": b"{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (3,)}\n",
    "no literal": b"{'descr': " + b"(" * 900 + b"\n",
    "nothing": b"",
}


@pytest.mark.parametrize("case", HEADERS)
@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_LZMA])
def test_npz_headers(tmp_path: Path, case: str, compression: int):
    _npz(tmp_path / "a.npz", HEADERS[case], compression)
    _refused(lambda: load_map(tmp_path / "a.npz"), "is not a readable npz file")


def test_npz_bomb_takes_no_memory(tmp_path: Path):
    """Oracle: Python's own count of memory, while 2 GiB of zeros in 2 MiB are refused."""
    stream = io.BytesIO()
    np.save(stream, np.zeros((8, 8, 2), np.float32))
    with (
        zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as file,
        file.open("map.npy", "w", force_zip64=True) as member,
    ):
        for _ in range(2048):
            member.write(bytes(1 << 20))
    tracemalloc.start()
    _refused(lambda: load_map(tmp_path / "a.npz"), "takes 2048 MiB")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50 << 20


def test_encrypted_npz(tmp_path: Path):
    save_map(tmp_path / "a.npz", q())
    data = bytearray((tmp_path / "a.npz").read_bytes())
    for mark, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.rfind(mark) + flags] |= 1
    (tmp_path / "a.npz").write_bytes(data)
    _refused(lambda: load_map(tmp_path / "a.npz"), "is not a readable npz file")


def test_bare_array(tmp_path: Path):
    np.save(tmp_path / "a.npy", q())
    (tmp_path / "a.npy").rename(tmp_path / "a.npz")
    _refused(lambda: load_map(tmp_path / "a.npz"), "is an array, not an npz file")


def _window(data: bytes, width: int, height: int) -> bytes:
    at = data.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    return data[:at] + struct.pack("<4i", 0, 0, width - 1, height - 1) + data[at + 16 :]


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((60_000, 60_000), "MITSUBA_ENDO_LIMIT_MAP"), ((24, 9_000), "cut short"),
        ((-5, 14), "not a readable OpenEXR"), ((2**31 - 1, 2**31 - 1), "MITSUBA_ENDO_LIMIT_MAP"),
    ],
)  # fmt: skip
def test_exr_that_promises_more_than_it_holds(tmp_path: Path, size: tuple[int, int], words: str):
    save_map(tmp_path / "a.exr", q())
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(_window(data, *size))
    _refused(lambda: read_exr(tmp_path / "a.exr"), words)


@pytest.mark.parametrize("compression", range(13))
@pytest.mark.parametrize("tiled", [False, True])
def test_exr_of_every_compression_is_read(tmp_path: Path, compression: int, tiled: bool):
    """Oracle: the values written by OpenEXR; half a percent for the compressions that lose."""
    import OpenEXR

    channels = {name: np.ascontiguousarray(c) for name, c in zip("xy", np.moveaxis(q(), -1, 0),
                                                                 strict=True)}  # fmt: skip
    header = {"compression": OpenEXR.Compression(compression)}
    header["type"] = OpenEXR.tiledimage if tiled else OpenEXR.scanlineimage
    try:
        if tiled:
            header["tiles"] = OpenEXR.TileDescription()
        OpenEXR.File(header, dict(channels)).write(str(tmp_path / "a.exr"))
    except Exception as error:
        pytest.skip(f"OpenEXR does not write it: {error}")
    found = read_exr(tmp_path / "a.exr")
    for name, channel in channels.items():
        np.testing.assert_allclose(found[name], channel, rtol=5e-3, atol=0.5)


def _png(width: int, height: int) -> bytes:
    data = bytearray(cv2.imencode(".png", np.zeros((3, 4), np.uint8))[1].tobytes())
    data[16:24] = struct.pack(">II", width, height)
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (_png(2**31 - 1, 2**31 - 1), "not a readable image"),
        (_png(100_000, 100_000), "not a readable image"),
        (_png(4, 3)[:33] + b"\xff\xff\xff\xf0" + _png(4, 3)[37:], "not a readable image"),
        (b"P5 60000 60000 255\n" + bytes(100), "not a readable image"),
        (b"BM" + bytes(16) + struct.pack("<iiHHI", 60_000, 60_000, 1, 24, 0), "not a readable"),
        (b"\xff\xd8\xff\xc0\0\x11\x08" + struct.pack(">HH", 60_000, 60_000), "LIMIT_PIXELS"),
        (b"", "not a readable image"), (b"GIF89a", "not a readable image"),
    ],
)  # fmt: skip
def test_image_headers(tmp_path: Path, data: bytes, words: str):
    (tmp_path / "a.png").write_bytes(data)
    _refused(lambda: read_image(tmp_path / "a.png"), words)


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "bmp", "ppm"])
@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (40, 61)])
def test_sound_images_are_read(tmp_path: Path, suffix: str, shape: tuple[int, int]):
    """Oracle: the pixels that OpenCV's writer was given; JPEG only their number."""
    image = np.random.default_rng(0).integers(0, 255, (*shape, 3)).astype(np.uint8)
    assert cv2.imwrite(str(tmp_path / f"a.{suffix}"), image)
    found = read_image(tmp_path / f"a.{suffix}")
    assert found.shape[:2] == shape
    if suffix != "jpg":
        np.testing.assert_array_equal(found, image)


def _ply(faces: list[list[int]], promised: int | None = None, extra: str = "") -> str:
    rows = "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)
    return (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {promised or len(faces)}\n"
        f"property list uchar int vertex_indices\nend_header\n0 0 {extra or '50'}\n9 0 50\n0 9 50\n"
        f"{rows}"
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_ply([[0, 1, 3]]), "triangles without vertices"),
        (_ply([[0, 1, -1]]), "triangles without vertices"),
        (_ply([[0, 1, 2]], extra="nan"), "finite vertices"),
        (_ply([[0, 1, 2]], extra="1e30"), "reaches farther"),
        (_ply([[0, 1, 2]], promised=10**12), "not a readable mesh"),
        (_ply([]), "no"),
    ],
)
def test_meshes(tmp_path: Path, text: str, words: str):
    (tmp_path / "a.ply").write_text(text)
    _refused(lambda: load_surface(tmp_path / "a.ply"), words)


def test_no_file_beside_a_mesh_is_opened(tmp_path: Path):
    """Oracle: a pipe as the material of an OBJ would be waited for."""
    os.mkfifo(tmp_path / "a.mtl")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf 1 2 3\n")
    assert _within_seconds(lambda: load_surface(tmp_path / "a.obj")) is None


def test_messages_quote_no_more_than_can_be_read(tmp_path: Path):
    """Oracle: 10 MB of a value in a file, and the length of the sentence."""
    (tmp_path / "a.json").write_text(json.dumps({"outcome": "x" * 10_000_000}))
    with pytest.raises(InputError) as caught:
        load_solution(tmp_path / "a.json")
    assert len(str(caught.value)) < 1000
    assert len(shown(list(range(10**6)))) <= 80
    assert shown(10**5000)
    said = str(InputError("a\x1b[31m\nb\r", "c\x07"))
    assert said.isprintable()


def test_what_is_written_can_be_read(tmp_path: Path):
    """Oracle: the limits of reading are those of this program's own files of usual sizes."""
    image = np.zeros((3000, 4000), np.float32)
    write_exr(tmp_path / "a.exr", {"a": image, "b": image})
    assert set(read_exr(tmp_path / "a.exr")) == {"a", "b"}
    assert MAP.limit() >= 4 * 2 * 8192 * 8192
    assert IMAGE.limit() >= 8192 * 4096
