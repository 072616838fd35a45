"""Commands that write, small, for being killed: their inputs, and what they leave when they end."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

RUN = (sys.executable, "-c", "from mitsuba_endo.cli.entry import main; main()")
SCENE = ("--set", "width=96", "--set", "height=72", "--set", "fx=68", "--set", "cx=48.2",
         "--set", "cy=35.4")  # fmt: skip
_OFTEN = """
import sys
from mitsuba_endo.cli import entry
entry._see_to_interrupts()
try:
    import mitsuba_endo.show.unfinished_folder as m
    m.UnfinishedFolder.__init__.__defaults__, m.SHARE = (0.0,), 0.0
    entry.main()
except KeyboardInterrupt:
    sys.exit(entry.EXIT_INTERRUPTED)
"""
OFTEN = (sys.executable, "-c", _OFTEN)
"""The command line, with the state of a sequence saved after every frame, not every 20 s."""
DATASET = "dataset"


@dataclass(frozen=True)
class Command:
    """A command, run in a folder that holds its inputs."""

    name: str
    arguments: tuple[str, ...]
    out: str
    """What it writes, a folder or a file."""
    prepare: Callable[[Path], None]
    """Makes the inputs."""
    program: tuple[str, ...] = RUN
    beside: str | None = None
    """Folder that it keeps beside its output while it is not finished."""
    resume: tuple[str, ...] = ()
    """Arguments to add where that folder lies there."""

    def arguments_in(self, folder: Path) -> tuple[str, ...]:
        """Return the arguments with which it starts, or goes on, in a folder."""
        goes_on = self.beside is not None and (folder / self.beside).exists()
        return (*self.arguments, *(self.resume if goes_on else ()))


def start(
    folder: Path, arguments: tuple[str, ...], program: tuple[str, ...] = RUN
) -> "subprocess.Popen[str]":
    """Start a command in a folder, with a temporary folder and a process group of its own."""
    temporary = folder / "tmp"
    temporary.mkdir(exist_ok=True)
    environment = {**os.environ, "TMPDIR": str(temporary), "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        [*program, *arguments], cwd=folder, env=environment, text=True, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def run(folder: Path, *arguments: str, program: tuple[str, ...] = RUN) -> None:
    """Run a command to its end.

    Raises:
        RuntimeError: it ends with another exit code than 0 and 1.
    """
    process = start(folder, arguments, program)
    _, said = process.communicate()
    if process.returncode not in (0, 1):
        raise RuntimeError(f"{arguments}: exit code {process.returncode}: {said}")


def _capture(folder: Path) -> None:
    run(folder, "render", "stomach", "--spp", "1", "--out", "capture", *SCENE)


def _recording(folder: Path) -> None:
    run(folder, "render", "stomach", "--trajectory", "withdrawal", "--frames", "8",
        "--out", "recording", *SCENE)  # fmt: skip


def _photograph(folder: Path) -> None:
    run(folder, "render", "stomach", "--spp", "8", "--out", "capture", "--set",
        "pattern=pattern:coded", "--set", "width=320", "--set", "height=240", "--set", "fx=226.7",
        "--set", "cx=160.6", "--set", "cy=118.1")  # fmt: skip


def _result(folder: Path) -> None:
    from .sound import sound

    shutil.copytree(sound("result"), folder / "result")


def _configuration(folder: Path) -> None:
    from .sound import sound

    shutil.copy(sound("dataset files") / "config.yaml", folder / "config.yaml")


def dataset_command(count: int, form: str) -> Command:
    """Return the command that makes so many samples in a format."""
    arguments = (
        "dataset",
        "config.yaml",
        "--out",
        DATASET,
        "--count",
        str(count),
        "--format",
        form,
    )
    return Command(f"dataset {form}", arguments, DATASET, _configuration)


COMMANDS: dict[str, Command] = {
    command.name: command
    for command in (
        Command("render", ("render", "stomach", "--spp", "1", "--out", "out", *SCENE), "out",
                lambda folder: None),
        Command("calibrate",
                ("calibrate", "capture/map.exr", "--rig", "capture/rig.yaml", "--out", "out"),
                "out", _capture),
        Command("decode",
                ("decode", "capture/image.png", "--rig", "capture/rig.yaml", "--out", "out"),
                "out", _photograph),
        Command("sequence",
                ("sequence", "recording/maps", "--rig", "recording/rig.yaml", "--out", "out",
                 "--quiet"),
                "out", _recording, OFTEN, "out.unfinished", ("--resume", "out")),
        Command("report", ("report", "result", "--out", "report.html"), "report.html", _result),
        dataset_command(30, "files"),
        dataset_command(30, "hdf5"),
    )
}  # fmt: skip
"""By name."""
