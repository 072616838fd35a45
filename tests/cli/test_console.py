"""What every command does alike: exit codes, clean stdout for JSON, help that starts fast."""

import json
import resource
import subprocess
import sys

import pytest
import typer

from mitsuba_endo.cli.console import session
from mitsuba_endo.errors import InputError, NothingDecodedError
from tests.cli.inputs import run


def _while_loading(cause: BaseException) -> InputError:
    """Return what becomes of an exception while an extension module is loaded."""
    fault, told = ImportError("extension"), InputError("Mitsuba cannot start")
    fault.__cause__, told.__cause__ = cause, fault
    return told


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (InputError("is odd", "a.yaml: b", "mend it"), 2, "error: a.yaml: b: is odd; mend it.\n"),
        (NothingDecodedError("no pattern", "a.png"), 3, "error: a.png: no pattern.\n"),
        (KeyboardInterrupt(), 130, "error: interrupted"),
        (_while_loading(KeyboardInterrupt()), 130, "error: interrupted"),
        (ZeroDivisionError("1/0"), 70, "error: internal fault (ZeroDivisionError: 1/0); "),
        (typer.Exit(1), 1, ""),
    ],
)
def test_exit_codes(error: BaseException, code: int, text: str, capsys: pytest.CaptureFixture[str]):
    """Oracle: the table of exit codes in the help."""
    with pytest.raises(typer.Exit) as end, session(quiet=False, as_json=False, debug=False):
        raise error
    assert end.value.exit_code == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(text)
    assert "Traceback" not in captured.err


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]):
    """Oracle: the contract."""
    with pytest.raises(typer.Exit), session(quiet=False, as_json=False, debug=True):
        raise ZeroDivisionError("1/0")
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("quiet", [False, True])
@pytest.mark.parametrize("as_json", [False, True])
def test_where_output_goes(quiet: bool, as_json: bool, capsys: pytest.CaptureFixture[str]):
    """Oracle: human output on stdout, with --json on stderr, with --quiet nowhere."""
    with session(quiet, as_json, debug=False) as output:
        output.print("for [reading]")
        output.summary({"x": 1})
    captured = capsys.readouterr()
    assert captured.out == ('{\n "x": 1\n}\n' if as_json else "" if quiet else "for [reading]\n")
    assert captured.err == ("for [reading]\n" if as_json and not quiet else "")


LOGGING_SCRIPT = """
import os, typer
from mitsuba_endo.cli.console import session
def command():
    with session(False, True, False) as output:
        os.write(1, b"a library's log\\n")  # as C++ prints, behind Python's back
        output.summary({"done": True})
    os.write(1, b"\\n")  # the real stdout is back
typer.run(command)
"""


def test_json_is_alone_on_stdout():
    """Oracle: the JSON parser, given all of stdout."""
    done = subprocess.run([sys.executable, "-c", LOGGING_SCRIPT], capture_output=True, text=True)
    assert json.loads(done.stdout) == {"done": True}
    assert "a library's log" in done.stderr


def test_help_loads_nothing_heavy():
    """Oracle: the interpreter's table of loaded modules."""
    script = "import sys, mitsuba_endo.cli.main; print(*sys.modules)"
    loaded = subprocess.check_output([sys.executable, "-c", script], text=True).split()
    heavy = {"mitsuba", "drjit", "matplotlib", "scipy", "numpy", "cv2", "pydantic"}
    assert heavy.isdisjoint(loaded)


def test_help_is_fast():
    """Oracle: the processor time of the child; half a second is what feels immediate."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "mitsuba_endo", "--help"]
    text = subprocess.check_output(command, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert "calibrate" in text
    spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    assert spent < 0.5


def test_help_lists_the_commands():
    """Oracle: the names in the README."""
    result = run("--help")
    assert result.exit_code == 0
    for name in ("demo", "doctor", "render", "calibrate", "evaluate"):
        assert name in result.stdout


def test_version():
    """Oracle: the package's metadata."""
    from importlib.metadata import version

    assert run("--version").stdout == version("mitsuba-endo") + "\n"


def test_long_work_tells_its_steps_in_a_log(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """Oracle: by hand, with a clock of the test's own: nothing of the first two seconds; a line for
    each step and frame; of one step's iterations a line in ten seconds."""
    from mitsuba_endo.cli import console

    now = [0.0]
    monkeypatch.setattr(console.time, "monotonic", lambda: now[0])
    with console.Session(False, False).progress("Starting") as advance:
        for seconds, step in (
            (1.0, "Searching, frame 1 of 3"), (3.0, "Searching, frame 2 of 3"),
            (3.5, "Searching, frame 3 of 3"), (4.0, "Optimising (iteration 1, f = 3.1 px)"),
            (5.0, "Optimising (iteration 2, f = 3.0 px)"),
            (15.0, "Optimising (iteration 3, f = 3.0 px)"),
        ):  # fmt: skip
            now[0] = seconds
            advance(0.5, step)
    assert capsys.readouterr().err.splitlines() == [
        "[   3.0 s] Searching, frame 2 of 3",
        "[   3.5 s] Searching, frame 3 of 3",
        "[   4.0 s] Optimising (iteration 1, f = 3.1 px)",
        "[  15.0 s] Optimising (iteration 3, f = 3.0 px)",
    ]
    with console.Session(True, False).progress("Starting") as advance:
        now[0] = 99.0
        advance(0.5, "Optimising")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["refine", "a.npz", "--out", "b.npz"], "Missing option '--image'"),
        (["evaluate"], "Missing argument 'RESULT'"),
        (["nosuch"], "No such command 'nosuch'"),
        (["calibrate", "--nosuch", "1"], "No such option: --nosuch"),
        (["dataset", "--out", "a", "--count", "-3"], "Invalid value for '--count'"),
    ],
)
def test_a_wrong_command_line_is_one_sentence(arguments: list[str], said: str):
    """Oracle: the contract of bad input; Typer draws a box of five lines."""
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith(f"error: {said}")
    assert result.stderr.endswith(" --help.\n")
    assert result.stderr.count("\n") == 1


def test_no_command_is_answered_with_the_help():
    """Oracle: the help that is asked for."""
    assert run().stdout.split() == run("--help").stdout.split()
    assert run().exit_code == 2
