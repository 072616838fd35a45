"""No command deletes a file that it did not write itself.

Oracle of every test: the bytes of everything on disk before the command.
"""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

import mitsuba_endo as me
from mitsuba_endo.cli.main import COMMANDS
from mitsuba_endo.dataset.contact_sheet import write_contact_sheets
from mitsuba_endo.dataset.reader import Dataset
from mitsuba_endo.errors import InputError
from mitsuba_endo.files import atomic_folder
from mitsuba_endo.folder_mark import Kind
from scripts.reliability.made_up import made_up
from tests.cli.inputs import Result, run
from tests.dataset.small import make_here, small_config
from tests.reliability.results import MARK, contents, write_inputs, write_result

Command = Callable[[Path, Path], Result]


def _patterns(base: Path, out: Path) -> Result:
    return run("patterns", "--pattern", "gray", "--width", 16, "--height", 8, "--out", out)


def _render(base: Path, out: Path) -> Result:
    return run("render", "plane", "--out", out, "--spp", 1)


def _decode(base: Path, out: Path) -> Result:
    return run("decode", base / "photo.png", "--rig", base / "rig.yaml", "--out", out)


def _calibrate(base: Path, out: Path) -> Result:
    return run("calibrate", base / "map.exr", "--rig", base / "rig.yaml", "--out", out)


def _demo(base: Path, out: Path) -> Result:
    return run("demo", "--out", out)


def _export(kind: str) -> Command:
    def export(base: Path, out: Path) -> Result:
        return run("export", base / "result", "--format", kind, "--out", out)

    return export


def _dataset(base: Path, out: Path) -> Result:
    return run("dataset", "--out", out, "--count", 1)


def _recording(base: Path, out: Path) -> Result:
    return run("render", "plane", "--trajectory", "creeping", "--frames", 2, "--out", out)


def _sequence(base: Path, out: Path) -> Result:
    return run("sequence", base / "map.exr", "--rig", base / "rig.yaml", "--out", out)


def _from_python(save: Callable[[Path], None]) -> Command:
    """Return a call as a command: what it raises is its sentence."""

    def command(base: Path, out: Path) -> Result:
        try:
            save(out)
        except InputError as error:
            return Result(error.exit_code, "", f"error: {error}\n")
        return Result(0, "", "")

    return command


FOLDERS: dict[str, tuple[Command, Kind]] = {
    "patterns": (_patterns, Kind.PATTERNS),
    "render": (_render, Kind.CAPTURE),
    "render sequence": (_recording, Kind.RECORDING),
    "sequence": (_sequence, Kind.SEQUENCE),
    "Result.save": (_from_python(lambda out: me.Result(made_up()).save(out)), Kind.CALIBRATION),
    # Nothing is found in it: refused before it is looked at, or the test fails.
    "TrackedSequence.save": (
        _from_python(lambda out: me.TrackedSequence(cast(Any, None)).save(out)), Kind.SEQUENCE,
    ),
    "decode": (_decode, Kind.MAPS),
    "calibrate": (_calibrate, Kind.CALIBRATION),
    "demo": (_demo, Kind.DEMO),
    "export colmap": (_export("colmap"), Kind.COLMAP),
    "export mitsuba": (_export("mitsuba"), Kind.SCENE),
    "export ros": (_export("ros"), Kind.ROS),
}  # fmt: skip
"""Every command and call that writes a folder which it may replace, and what it calls that."""


@pytest.fixture
def base(tmp_path: Path) -> Path:
    write_result(tmp_path / "result")
    return write_inputs(tmp_path)


def _marked(path: Path, kind: Kind) -> Path:
    with atomic_folder(path, kind) as folder:
        (folder / "value.txt").write_text("made by the program")
    return path


def _refused(result: Result, *words: str) -> None:
    assert result.exit_code == 2, (result.stdout, result.stderr)
    assert len(result.stderr.splitlines()) == 1, result.stderr
    for word in words:
        assert word in result.stderr


@pytest.mark.parametrize("name", FOLDERS)
def test_folder_of_another_kind_stays(base: Path, name: str):
    command, kind = FOLDERS[name]
    other = Kind.VIEWS
    out = _marked(base / "out", other)
    before = contents(base)
    _refused(command(base, out), f"holds {other}, not {kind}")
    assert contents(base) == before


@pytest.mark.parametrize("name", FOLDERS)
@pytest.mark.parametrize("note", ["notes.txt", "maps/notes.txt"])
def test_folder_with_the_users_notes_stays(base: Path, name: str, note: str):
    command, kind = FOLDERS[name]
    out = _marked(base / "out", kind)
    (out / note).parent.mkdir(exist_ok=True)
    (out / note).write_text("mine")
    before = contents(base)
    _refused(command(base, out), note, "did not write", "move it away")
    assert contents(base) == before


@pytest.mark.parametrize("name", FOLDERS)
@pytest.mark.parametrize("text", ["", "{", '{"kind": "a demo"}', "[1]", "[" * 100_000])
def test_folder_whose_list_is_missing_stays(base: Path, name: str, text: str):
    """As version 0.1 marked folders, and as damage leaves them."""
    command, _ = FOLDERS[name]
    (base / "out").mkdir()
    (base / "out" / MARK).write_text(text)
    (base / "out" / "solution.json").write_text("mine?")
    before = contents(base)
    _refused(command(base, base / "out"), "has no list", "remove it yourself")
    assert contents(base) == before


@pytest.mark.parametrize("name", [*FOLDERS, "dataset"])
def test_unmarked_folder_stays(base: Path, name: str):
    command = FOLDERS[name][0] if name in FOLDERS else _dataset
    (base / "out").mkdir()
    (base / "out" / "thesis.tex").write_text("mine")
    before = contents(base)
    _refused(command(base, base / "out"), "choose an empty folder")
    assert contents(base) == before


OWN = ["patterns", "export colmap", "export mitsuba", "export ros", "Result.save"]


@pytest.mark.parametrize("name", OWN)
def test_own_folder_is_replaced(base: Path, name: str):
    """Oracle: the files of a second run alone; those of the first are gone."""
    command, kind = FOLDERS[name]
    out = _marked(base / "out", kind)
    result = command(base, out)
    assert result.exit_code == 0, result.stderr
    assert "value.txt" not in contents(out)
    again = command(base, out)
    assert again.exit_code == 0, again.stderr


def test_folder_whose_files_the_user_removed_is_replaced(base: Path):
    out = _marked(base / "out", Kind.PATTERNS)
    (out / "value.txt").unlink()
    assert _patterns(base, out).exit_code == 0


def test_notes_written_during_the_work_stay(tmp_path: Path):
    """Oracle: the note that comes between the check and the end."""
    out = _marked(tmp_path / "out", Kind.MAPS)
    with (
        pytest.raises(ValueError, match=r"notes\.txt, which mitsuba-endo did not write"),
        atomic_folder(out, Kind.MAPS),
    ):
        (out / "notes.txt").write_text("mine")
    assert contents(tmp_path).keys() == {f"out/{name}" for name in (MARK, "notes.txt", "value.txt")}


def test_a_link_in_an_own_folder_is_not_followed(tmp_path: Path):
    """Oracle: the files that the link leads to; the link itself is a foreign file."""
    out = _marked(tmp_path / "out", Kind.MAPS)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.png").write_text("mine")
    (out / "photos").symlink_to(tmp_path / "photos")
    with pytest.raises(ValueError, match="holds photos, which"), atomic_folder(out, Kind.MAPS):
        pass
    assert (tmp_path / "photos" / "a.png").read_text() == "mine"


def test_export_into_the_result_that_it_reads(base: Path):
    """The first example of the report that led here: the solution was deleted."""
    with atomic_folder(base / "own", Kind.CALIBRATION) as folder:
        write_result(folder)
    before = contents(base)
    for out, how in (("own", "is also an input"), ("own/scene", "lies in")):
        for kind in ("mitsuba", "colmap"):
            result = run("export", base / "own", "--format", kind, "--out", base / out)
            _refused(result, how, "choose another output folder")
    assert contents(base) == before


def test_decode_over_a_calibration(base: Path):
    """The second example: the calibration and the notes in it were deleted."""
    out = _marked(base / "out", Kind.CALIBRATION)
    (out / "notes.txt").write_text("mine")
    before = contents(base)
    _refused(_decode(base, out), "holds a calibration, not decoded maps")
    assert contents(base) == before


def test_calibrate_over_its_own_input(base: Path):
    """The third example: the map and the rig were deleted, and the exit code was 0."""
    for kind in (Kind.CAPTURE, Kind.CALIBRATION):
        with atomic_folder(base / kind.name, kind) as folder:
            write_inputs(folder)
    before = contents(base)
    for kind in (Kind.CAPTURE, Kind.CALIBRATION):
        inp = base / kind.name
        result = run("calibrate", inp / "map.exr", "--rig", inp / "rig.yaml", "--out", inp)
        _refused(result, "contains", "an input of this command")
    assert contents(base) == before


INSIDE = {
    "decode image": (("decode", "in/photo.png", "--rig", "rig.yaml"), Kind.MAPS),
    "decode folder": (("decode", "in", "--rig", "rig.yaml"), Kind.MAPS),
    "decode rig": (("decode", "photo.png", "--rig", "in/rig.yaml"), Kind.MAPS),
    "decode weights": (
        ("decode", "photo.png", "--rig", "rig.yaml", "--weights", "in/map.exr"), Kind.MAPS,
    ),
    "calibrate map": (("calibrate", "in/map.exr", "--rig", "rig.yaml"), Kind.CALIBRATION),
    "calibrate rig": (("calibrate", "map.exr", "--rig", "in/rig.yaml"), Kind.CALIBRATION),
    "calibrate resume": (
        ("calibrate", "map.exr", "--rig", "rig.yaml", "--resume", "in"), Kind.CALIBRATION,
    ),
    "render scene": (("render", "in/rig.yaml"), Kind.CAPTURE),
    "render setting": (("render", "plane", "--set", "pattern=in/photo.png"), Kind.CAPTURE),
    "render trajectory": (
        ("render", "plane", "--trajectory", "in/rig.yaml", "--frames", "2"), Kind.RECORDING,
    ),
    "sequence map": (("sequence", "in/map.exr", "--rig", "rig.yaml"), Kind.SEQUENCE),
    "sequence rig": (("sequence", "map.exr", "--rig", "in/rig.yaml"), Kind.SEQUENCE),
    "sequence mask": (
        ("sequence", "map.exr", "--rig", "rig.yaml", "--mask", "in/photo.png"), Kind.SEQUENCE,
    ),
    "export ros": (("export", "in/result", "--format", "ros"), Kind.ROS),
    "export colmap": (("export", "in/result", "--format", "colmap"), Kind.COLMAP),
    "export mitsuba": (("export", "in/result/solution.json", "--format", "mitsuba"), Kind.SCENE),
}  # fmt: skip
"""Every way to name an input that lies in a folder ``in`` of the kind that the command writes."""


@pytest.mark.parametrize("case", INSIDE)
@pytest.mark.parametrize("through", ["name", "link"])
def test_output_over_an_input(base: Path, monkeypatch: pytest.MonkeyPatch, case: str, through: str):
    arguments, kind = INSIDE[case]
    with atomic_folder(base / "in", kind) as folder:
        write_inputs(folder)
        write_result(folder / "result")
    monkeypatch.chdir(base)
    if through == "link":
        (base / "elsewhere").symlink_to(base / "in")
        arguments = tuple(a.replace("in/", "elsewhere/") for a in arguments)
    before = contents(base)
    _refused(run(*arguments, "--out", "in"), "an input of this command")
    assert contents(base) == before


FILES = {
    "decode-stack": (
        ("decode-stack", "a.exr", "b.exr", "--pattern", "gray", "--width", 2, "--height", 2),
        ("a.exr", "b.exr"),
    ),
    "evaluate": (
        ("evaluate", "own", "--truth", "truth/truth.json"),
        ("own/solution.json", "own/surface.ply", "truth/truth.json", "truth/surface.ply"),
    ),
    "report": (("report", "own", "--truth", "truth/page.html"), ("own/page.html",
                                                                "truth/page.html")),
    "report of several": (
        ("report", "result", "own", "--truth", "truth/page.html"),
        ("own/page.html", "truth/page.html"),
    ),
    "refine": (
        ("refine", "own/map.npz", "--image", "a.exr", "--rig", "rig.yaml", "--pattern", "b.exr",
         "--mask", "masks"),
        ("own/map.npz", "a.exr", "b.exr", "masks/map.exr"),
    ),
    "export kalibr": (("export", "own", "--format", "kalibr"), ("own/solution.json",)),
    "export ply": (("export", "own", "--format", "ply"), ("own/solution.json", "own/surface.ply")),
    "export opencv": (("export", "own", "--format", "opencv"), ("own/solution.json",)),
}  # fmt: skip
"""Every command that writes a file, and the inputs in whose place it was able to write."""


@pytest.mark.parametrize(
    ("name", "target"), [(name, target) for name in FILES for target in FILES[name][1]]
)
@pytest.mark.parametrize("through", ["name", "link"])
def test_output_file_that_is_an_input(
    base: Path, monkeypatch: pytest.MonkeyPatch, name: str, target: str, through: str
):
    monkeypatch.chdir(base)
    for folder, kind, file in (("own", Kind.CALIBRATION, "solution.json"),
                               ("truth", Kind.CAPTURE, "truth.json")):  # fmt: skip
        with atomic_folder(base / folder, kind) as aside:
            write_result(aside, file)
            (aside / "page.html").write_text("mine")
            (aside / "map.npz").write_text("mine")
    (base / "masks").mkdir()
    for image in ("a.exr", "b.exr", "masks/map.exr"):
        (base / image).write_bytes((base / "map.exr").read_bytes())
    out = Path(target)
    if through == "link":
        out = Path(f"elsewhere{out.suffix}")
        (base / out).symlink_to(base / target)
    before = contents(base)
    _refused(run(*FILES[name][0], "--out", out), "choose another name")
    assert contents(base) == before


def test_every_command_that_writes_is_among_them():
    """Oracle: the commands' own options."""
    writing = {c.__name__ for c in COMMANDS if "out" in inspect.signature(c).parameters}
    tried = {name.partition(" ")[0].replace("-", "_") for name in [*FOLDERS, *FILES, "dataset"]}
    assert writing <= tried


def test_reports_and_metrics_may_be_replaced_in_a_result(base: Path, monkeypatch):
    """Oracle: exit code 0 for a second metrics.json within the folder of the result."""
    monkeypatch.chdir(base)
    write_result(base / "truth", "truth.json")
    command = ("evaluate", "result", "--truth", "truth/truth.json", "--out", "result/metrics.json")
    for _ in range(2):
        assert run(*command).exit_code == 0


def test_a_dataset_keeps_the_users_files(tmp_path: Path):
    """Oracle: notes beside, within and named like what a second run of a dataset clears away."""
    config, out = small_config(), tmp_path / "out"
    make_here(config, out, 2)
    notes = [
        "notes.txt", "contact_sheet_best.png", "samples/notes.txt", "samples/.my.partial/a.txt",
        "failed/notes.txt", ".workshop/notes.npz", "samples/000001/notes.txt",
    ]  # fmt: skip
    for note in notes:
        (out / note).parent.mkdir(exist_ok=True)
        (out / note).write_text("mine")
    before = contents(out)
    make_here(config, out, 3, retry_failed=True)
    write_contact_sheets(Dataset(out))
    after = contents(out)
    assert {note: after.get(note) for note in notes} == dict.fromkeys(notes, b"mine")
    kept = {name for name in before if name.startswith("samples/")}
    assert {name: after[name] for name in kept} == {name: before[name] for name in kept}
