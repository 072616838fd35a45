"""Writing is all or nothing, whatever ends it."""

import os
from pathlib import Path

import pytest

from mitsuba_endo import files
from mitsuba_endo.errors import InputError
from mitsuba_endo.files import atomic_folder, atomic_path
from mitsuba_endo.folder_mark import Kind
from mitsuba_endo.outputs import check_folder

INTERRUPTIONS = [ValueError, KeyboardInterrupt, SystemExit]


def _everything(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}


def _write_folder(path: Path, text: str) -> None:
    with atomic_folder(path, Kind.MAPS) as aside:
        (aside / "value.txt").write_text(text)


def _write_half(path: Path, interruption: type[BaseException]) -> None:
    path.write_text("half")
    raise interruption


def test_path_is_written_and_parents_made(tmp_path: Path):
    """Oracle: the text put in, at the place asked for, and nothing beside it."""
    with atomic_path(tmp_path / "a" / "b.txt") as aside:
        assert aside.suffix == ".txt"
        aside.write_text("new")
    assert (tmp_path / "a" / "b.txt").read_text() == "new"
    assert _everything(tmp_path) == {"a", "a/b.txt"}


@pytest.mark.parametrize("interruption", INTERRUPTIONS)
@pytest.mark.parametrize("before", [None, "old"])
def test_interrupted_path_keeps_what_was_there(
    tmp_path: Path, interruption: type[BaseException], before: str | None
):
    """Oracle: the folder's content before the attempt."""
    path = tmp_path / "b.txt"
    if before:
        path.write_text(before)
    expected = _everything(tmp_path)
    with pytest.raises(interruption), atomic_path(path) as aside:
        _write_half(aside, interruption)
    assert _everything(tmp_path) == expected
    assert not before or path.read_text() == before


def test_new_folder(tmp_path: Path):
    """Oracle: the file written inside; the mark that lets a later run replace it."""
    _write_folder(tmp_path / "deep" / "out", "1")
    assert (tmp_path / "deep" / "out" / "value.txt").read_text() == "1"
    assert _everything(tmp_path) == {
        "deep", "deep/out", "deep/out/value.txt", "deep/out/.mitsuba-endo",
    }  # fmt: skip


def test_folder_follows_the_umask(tmp_path: Path):
    """Oracle: mode 0777 less the umask, as mkdir gives it; mkdtemp alone would give 0700."""
    before = os.umask(0o027)
    try:
        _write_folder(tmp_path / "out", "1")
    finally:
        os.umask(before)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o750


def test_own_folder_is_replaced_as_a_whole(tmp_path: Path):
    """Oracle: only the second run's files are left."""
    with atomic_folder(tmp_path / "out", Kind.MAPS) as aside:
        (aside / "stale.txt").touch()
    _write_folder(tmp_path / "out", "2")
    assert _everything(tmp_path) == {"out", "out/value.txt", "out/.mitsuba-endo"}


@pytest.mark.parametrize("interruption", INTERRUPTIONS)
@pytest.mark.parametrize("existing", [True, False])
def test_interrupted_folder_keeps_what_was_there(
    tmp_path: Path, interruption: type[BaseException], existing: bool
):
    """Oracle: the folder's content before the attempt."""
    out = tmp_path / "out"
    if existing:
        _write_folder(out, "old")
    expected = _everything(tmp_path)
    with pytest.raises(interruption), atomic_folder(out, Kind.MAPS) as aside:
        _write_half(aside / "value.txt", interruption)
    assert _everything(tmp_path) == expected
    assert not existing or (out / "value.txt").read_text() == "old"


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, OSError])
def test_interrupted_between_the_two_renames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interruption: type[BaseException]
):
    """Oracle: the older result, complete, although it had been moved aside already."""
    out = tmp_path / "out"
    _write_folder(out, "old")
    expected = _everything(tmp_path)
    real, calls = os.replace, []

    def second_fails(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) == 2:
            raise interruption
        real(source, target)

    monkeypatch.setattr(files.os, "replace", second_fails)
    with pytest.raises(KeyboardInterrupt if interruption is KeyboardInterrupt else InputError):
        _write_folder(out, "new")
    assert len(calls) == 3
    assert (out / "value.txt").read_text() == "old"
    assert _everything(tmp_path) == expected


def test_foreign_folder_is_refused_and_untouched(tmp_path: Path):
    """Oracle: the foreign file, and a sentence that names the folder."""
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match=r"did not write; choose an empty folder"):
        _write_folder(tmp_path, "1")
    assert _everything(tmp_path) == {"thesis.tex"}


def test_empty_folder_is_accepted(tmp_path: Path):
    """Oracle: the file written inside."""
    (tmp_path / "out").mkdir()
    _write_folder(tmp_path / "out", "1")
    assert (tmp_path / "out" / "value.txt").read_text() == "1"


def test_current_folder_is_accepted_as_a_dot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle: the file written inside; Path('.') has no name of its own to derive others from."""
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path / "out")
    _write_folder(Path("."), "1")
    assert (tmp_path / "out" / "value.txt").read_text() == "1"


@pytest.mark.parametrize("kind", ["file", "link"])
def test_not_a_folder_is_refused(tmp_path: Path, kind: str):
    """Oracle: a sentence that names it, and the thing itself still there."""
    out = tmp_path / "out"
    if kind == "file":
        out.write_text("x")
    else:
        (tmp_path / "target").mkdir()
        out.symlink_to(tmp_path / "target")
    with pytest.raises(InputError, match=r"out: exists and is not a folder"):
        check_folder(out, Kind.MAPS)
    assert out.is_symlink() or out.read_text() == "x"


def test_parent_that_is_a_file_is_refused(tmp_path: Path):
    """Oracle: a sentence that names the path, for folders and for files alike."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        check_folder(tmp_path / "file" / "out", Kind.MAPS)
    with pytest.raises(InputError, match="cannot be written"):
        _write_folder(tmp_path / "file" / "out", "1")
    with pytest.raises(InputError, match="cannot be written"), atomic_path(tmp_path / "file" / "a"):
        pass
    assert _everything(tmp_path) == {"file"}


def test_folder_without_permission_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle: a sentence instead of work. Root may write anywhere, so the answer is replaced."""
    monkeypatch.setattr(files.os, "access", lambda path, mode: False)
    with pytest.raises(InputError, match="choose a folder you may write to"):
        check_folder(tmp_path / "out", Kind.MAPS)


def test_block_is_not_entered_when_the_file_cannot_be_made(tmp_path: Path):
    """Oracle: the name of an existing folder cannot be that of a file; its content stays."""
    (tmp_path / "taken").mkdir()
    with (
        pytest.raises(InputError, match="taken: cannot be written"),
        atomic_path(tmp_path / "taken") as aside,
    ):
        aside.write_text("x")
    assert _everything(tmp_path) == {"taken"}
