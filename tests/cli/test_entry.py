"""Ctrl-C and SIGTERM before and while libraries are loaded."""

import subprocess
import sys
from pathlib import Path

import pytest

HOOK = """
import os, signal, sys

class Interrupt:
    # Sends a signal to its own process when a module is first looked for.
    def find_spec(self, name, path=None, target=None):
        if name == {module!r} and self in sys.meta_path:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.{number})

sys.meta_path.insert(0, Interrupt())
sys.argv = ["mitsuba-endo", *{arguments!r}]
"""
RUN = "from mitsuba_endo.cli.entry import main; main()"


@pytest.mark.parametrize(
    "module",
    [
        "networkx",  # trimesh loads it within `except BaseException`
        "scipy.ndimage._ndimage_api",  # a module half made leads to other errors
        "typer",
        "mitsuba_endo.rendering.scene",
    ],
)
@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_an_interrupt_while_a_module_is_loaded_ends_the_command(
    module: str, number: str, tmp_path: Path
):
    """Oracle: exit code 130, one sentence or none, and an empty folder."""
    out = tmp_path / "made"
    hook = HOOK.format(
        module=module, number=number, arguments=["render", "plane", "--spp", "1", "--out", str(out)]
    )
    done = subprocess.run([sys.executable, "-c", hook + RUN], capture_output=True, text=True,
                          timeout=120)  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr in ("", "error: interrupted; no output was left half written.\n")
    assert not list(tmp_path.iterdir())


def test_the_hook_interrupts():
    """Oracle: without this package's handler Python raises KeyboardInterrupt there."""
    hook = HOOK.format(module="networkx", number="SIGINT", arguments=[])
    run = "try:\n    import networkx\nexcept KeyboardInterrupt:\n    sys.exit(7)"
    assert subprocess.run([sys.executable, "-c", hook + run], timeout=60).returncode == 7


LOST = """
import os, signal, sys, weakref
from mitsuba_endo.cli import entry

class Thing:
    pass

def gone(_reference):
    os.kill(os.getpid(), signal.SIGTERM)
    sum(range(100))  # Python calls the signal's handler between two instructions

entry._see_to_interrupts()
thing = Thing()
reference = weakref.ref(thing, gone)
try:
    del thing
    import time
    time.sleep(20)
except KeyboardInterrupt:
    print("felt")
"""


def test_an_interrupt_in_a_callback_of_python_is_not_lost():
    """Oracle: Python prints and drops what a weak reference's callback raises."""
    done = subprocess.run([sys.executable, "-c", LOST], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("felt\n", "")
