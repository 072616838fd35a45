"""``mitsuba-endo doctor``: what of the installation works, and how to mend the rest."""

import importlib.metadata
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from .. import __version__
from ..litter import sweep, sweep_scratch
from .console import EXIT_FAULT, Debug, Json, Quiet, Session, session

if TYPE_CHECKING:
    from rich.table import Table

Status = Literal["ok", "absent", "not tried", "fault"]
TIMEOUT_S = 90
"""Far above what a probe takes on a slow disk with nothing compiled yet."""
ABORTING_LLVM = "Cannot select"
NEED_A_VARIANT = ("threads", "exr", "plugins")
PROBES = ("llvm", "llvm_ad_rgb", "cuda_ad_rgb", "scalar_rgb", *NEED_A_VARIANT)
"""Names in :mod:`mitsuba_endo.cli.probes`, which only child processes import."""
EXTRAS = {
    "decode": ("faster decoding", ("onnxruntime",)),
    "view": ("the live viewer", ("viser",)),
    "dataset": ("HDF5 stores and clusters", ("h5py", "dask", "distributed")),
}
"""Of every extra that users want: what it is for, and its packages."""


@dataclass(frozen=True)
class Check:
    """One line of the table."""

    name: str
    status: Status
    """``absent``: not there, and not needed."""
    found: str
    mend: str = ""


def doctor(quiet: Quiet = False, as_json: Json = False, debug: Debug = False) -> None:
    """Say what of the installation works, and how to mend what does not."""
    with session(quiet, as_json, debug) as out:
        checks = examine(out)
        works = not any(check.status == "fault" for check in checks)
        out.print(_table(checks))
        out.print("Everything that is needed works." if works else "Faults were found, see above.")
        out.summary({"works": works, "checks": [asdict(check) for check in checks]})
        if not works:
            raise typer.Exit(EXIT_FAULT)


def examine(out: Session) -> list[Check]:
    """Run every probe, each in its own process."""
    checks = [_versions()]
    with out.progress("Looking at the installation") as advance:
        for i, name in enumerate(PROBES):
            advance(i / len(PROBES), f"Trying {name}")
            if name in NEED_A_VARIANT and not _has_variant(checks):
                checks.append(Check(name, "not tried", "needs llvm_ad_rgb or cuda_ad_rgb"))
            else:
                checks.append(_judge(name, *run_probe(name)))
    return [*_without_needless_faults(checks), *_extras(), _leftovers()]


def _extras() -> list[Check]:
    """Say which extras are installed: without one, what it is for is refused by name."""
    return [
        _extra(name, use, packages, importlib.metadata.version)
        for name, (use, packages) in EXTRAS.items()
    ]


def _extra(name: str, use: str, packages: Sequence[str], version: Callable[[str], str]) -> Check:
    installed = []
    for package in packages:
        try:
            installed.append(f"{package} {version(package)}")
        except importlib.metadata.PackageNotFoundError:
            todo = f'pip install "mitsuba-endo[{name}]"'
            return Check(f"extra {name}", "absent", f"{use}: {package} is not installed", todo)
    return Check(f"extra {name}", "ok", ", ".join(installed))


def _leftovers() -> Check:
    """Remove what processes that were killed left half written, here and in the temporary folder.

    Other folders are cleared by the next command that writes there.
    """
    removed = [*sweep_scratch(), *sweep(Path.cwd())]
    return Check("leftovers", "ok", f"removed {len(removed)}" if removed else "none")


def _has_variant(checks: list[Check]) -> bool:
    return any(c.status == "ok" for c in checks if c.name in ("llvm_ad_rgb", "cuda_ad_rgb"))


def run_probe(name: str) -> tuple[bool, str]:
    """Run one probe in a child process; return whether it succeeded and what it said."""
    command = [sys.executable, "-m", "mitsuba_endo.cli.probes", name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return False, f"did not end within {TIMEOUT_S} s"
    if done.returncode == 0:
        return True, _last_line(done.stdout)
    said = _last_line(done.stderr)
    if done.returncode < 0:
        return False, f"the process was killed by signal {-done.returncode}: {said}"
    return False, said


def _versions() -> Check:
    versions = [f"mitsuba-endo {__version__}", f"Python {platform.python_version()}"]
    for package in ("mitsuba", "drjit", "numpy"):
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            todo = "pip install mitsuba-endo"
            return Check("versions", "fault", f"{package} is not installed", todo)
    return Check("versions", "ok", ", ".join(versions))


def _judge(name: str, succeeded: bool, said: str) -> Check:
    if succeeded:
        return Check(name, "ok", said)
    if name == "cuda_ad_rgb":
        return Check(name, "absent", "no usable NVIDIA GPU and driver; LLVM is used instead")
    if name in ("llvm", "llvm_ad_rgb") or ABORTING_LLVM in said:
        return Check(name, "fault", said, mend_llvm())
    if name == "threads":
        return Check(name, "fault", said, "give the process at least two threads")
    todo = "pip install --force-reinstall mitsuba-endo; if that does not help, report it"
    return Check(name, "fault", said, todo)


def _without_needless_faults(checks: list[Check]) -> list[Check]:
    """With a usable GPU, LLVM is not needed; the scalar variant is for debugging only."""
    usable = {check.name for check in checks if check.status == "ok"}
    needless = {"scalar_rgb"} | ({"llvm", "llvm_ad_rgb"} if "cuda_ad_rgb" in usable else set())
    return [
        replace(c, status="absent") if c.name in needless and c.status == "fault" else c
        for c in checks
    ]


def mend_llvm() -> str:
    """Return how to install a usable LLVM on this platform."""
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return _unset_if_set() + f"pip install {_llvm_requirement()}"
    if "CONDA_PREFIX" in os.environ:
        return "conda install -c conda-forge libllvm20" + _point_at("$CONDA_PREFIX/lib/libLLVM*")
    if sys.platform == "darwin":
        return "brew install llvm" + _point_at("$(brew --prefix llvm)/lib/libLLVM.dylib")
    if _is_debian():
        return (
            "sudo apt install libllvm19 (Debian 12: from apt.llvm.org; 15 and 16 abort, 14 is "
            "refused)" + _point_at("the libLLVM*.so* it installs")
        )
    return "install LLVM 17 or newer" + _point_at("its libLLVM (Windows: LLVM-C.dll)")


def _unset_if_set() -> str:
    return "unset DRJIT_LIBLLVM_PATH; " if "DRJIT_LIBLLVM_PATH" in os.environ else ""


def _point_at(library: str) -> str:
    return f", then set DRJIT_LIBLLVM_PATH to {library}"


def _llvm_requirement() -> str:
    """Return the wheel with LLVM as the package's own metadata pins it."""
    from ..backend import LLVM_PACKAGE

    for requirement in importlib.metadata.requires("mitsuba-endo") or []:
        if requirement.startswith(LLVM_PACKAGE):
            return re.split(r"\s*;", requirement)[0]
    return LLVM_PACKAGE


def _is_debian() -> bool:
    release = Path("/etc/os-release")
    return release.is_file() and "debian" in release.read_text(encoding="utf-8").lower()


def _last_line(text: str) -> str:
    """Return the last line that says something, without the name of an exception before it."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return re.sub(r"^[\w.]*(Error|Exception): ", "", lines[-1]) if lines else "no message"


def _table(checks: list[Check]) -> "Table":
    from rich.table import Table
    from rich.text import Text

    colours = {"ok": "green", "absent": "yellow", "not tried": "yellow", "fault": "red"}
    table = Table(title="Installation of mitsuba-endo")
    for column in ("Check", "Status", "Found"):
        table.add_column(column, overflow="fold")
    mends = any(check.mend for check in checks)
    if mends:
        table.add_column("How to mend it", overflow="fold")
    for check in checks:
        # Text, because rich would read square brackets in a message as markup.
        row = [Text(check.name), Text(check.status, colours[check.status]), Text(check.found)]
        table.add_row(*row, *([Text(check.mend)] if mends else []))
    return table
