"""Ctrl-C at the moments that the campaign of kills found: nothing is left, and nothing is blamed.

Oracle: KeyboardInterrupt, which the command line ends with code 130, and the files afterwards.
"""

import contextlib
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from mitsuba_endo import litter
from mitsuba_endo.files import atomic_folder
from mitsuba_endo.folder_mark import Kind
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.interrupts import as_interrupts
from mitsuba_endo.litter import scratch_folder
from scripts.benchmarks.plane_under_grid import plane_under_grid

if TYPE_CHECKING:
    from mitsuba_endo.capture.photograph_scene import PhotographScene


@pytest.mark.usefixtures("llvm")
def test_an_interrupt_while_a_scene_is_loaded_is_no_fault_of_the_scene(monkeypatch):
    """Mitsuba makes a RuntimeError of whatever a plugin of Python's raises."""
    from mitsuba_endo.rendering.mitsuba_modules import mi
    from mitsuba_endo.rendering.scene import load_scene

    load, felt = mi.load_file, []

    def as_mitsuba(*arguments: object, **parameters: object) -> object:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            felt.append(True)
            raise RuntimeError('plugin of type "doe_projector"') from None
        return load(*arguments, **parameters)

    monkeypatch.setattr(mi, "load_file", as_mitsuba)
    with pytest.raises(KeyboardInterrupt):
        load_scene("plane")
    assert not felt


@pytest.mark.usefixtures("llvm")
def test_an_interrupt_while_a_photographs_scene_is_loaded_waits(monkeypatch):
    """As for a scene's file. Oracle: it is felt after Mitsuba's call, not within it."""
    from mitsuba_endo.rendering.mitsuba_modules import mi

    load, felt = mi.load_dict, []

    def as_mitsuba(described: dict[str, object], *arguments: object, **parameters: object):
        if described.get("type") == "scene":
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                felt.append(True)
                raise RuntimeError('plugin of type "doe_projector"') from None
        return load(described, *arguments, **parameters)

    monkeypatch.setattr(mi, "load_dict", as_mitsuba)
    with pytest.raises(KeyboardInterrupt):
        _photograph_scene()
    assert not felt


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("what", ["capture", "photograph"])
def test_an_interrupt_while_light_is_traced_is_none_of_the_plugins(monkeypatch, what: str):
    """Dr.Jit makes a RuntimeError of it. Oracle: Ctrl-C in the middle of the emitter's method."""

    from mitsuba_endo.rendering.render import render_capture
    from mitsuba_endo.rendering.scene import load_scene

    def struck(*arguments: object) -> None:
        signal.raise_signal(signal.SIGINT)

    loaded = load_scene("plane", width=48, height=36)
    # The class that this variant has: plugins are registered anew for each.
    monkeypatch.setattr(type(loaded.emitter()), "sample_direction", struck)
    if what == "photograph":
        scene = _photograph_scene()
        scene.set_poses(RigidTransform.identity(), RigidTransform.identity())
        with pytest.raises(KeyboardInterrupt):
            scene.trace(0)
    else:
        with pytest.raises(KeyboardInterrupt):
            render_capture(loaded, spp=1)


def test_an_interrupt_that_became_another_error_is_one_again():
    """Oracle: the error raised, by what stands behind the one of the library."""
    with pytest.raises(KeyboardInterrupt), as_interrupts():
        _of_a_library(KeyboardInterrupt())
    with pytest.raises(RuntimeError), as_interrupts():
        _of_a_library(ValueError("a number"))


def _of_a_library(cause: BaseException) -> None:
    try:
        raise cause
    except BaseException as error:
        raise RuntimeError("custom operation") from error


def _photograph_scene() -> "PhotographScene":
    from mitsuba_endo.capture.photograph_scene import PhotographScene, SceneParts
    from mitsuba_endo.capture.settings import CaptureSettings

    setup = plane_under_grid()
    size = setup.grid.width, setup.grid.height
    parts = SceneParts(setup.mesh, setup.camera, setup.projector, setup.grid.image(), size)
    return PhotographScene(parts, CaptureSettings(spp=1))


@pytest.mark.parametrize("kind", ["scratch", "output"])
def test_an_interrupt_just_after_a_folder_was_made_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
):
    monkeypatch.setattr(litter.tempfile, "tempdir", str(tmp_path))
    mkdir = Path.mkdir

    def made(self: Path, *arguments: object, **options: object) -> None:
        mkdir(self, *arguments, **options)  # type: ignore[arg-type]
        if ".endo-" in self.name:
            raise KeyboardInterrupt

    monkeypatch.setattr(Path, "mkdir", made)
    folder = scratch_folder() if kind == "scratch" else atomic_folder(tmp_path / "out", Kind.MAPS)
    with pytest.raises(KeyboardInterrupt), folder:
        pass
    assert not list(tmp_path.iterdir())


def test_an_interrupt_while_a_folder_is_removed_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(litter.tempfile, "tempdir", str(tmp_path))
    rmtree = shutil.rmtree

    def interrupted(*arguments: object, **options: object) -> None:
        signal.raise_signal(signal.SIGINT)
        rmtree(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(litter.shutil, "rmtree", interrupted)
    with pytest.raises(KeyboardInterrupt), contextlib.ExitStack() as stack:
        (stack.enter_context(scratch_folder()) / "map.exr").touch()
    assert not list(tmp_path.iterdir())


def test_an_interrupt_that_was_put_off_is_held_back_too():
    """One that came while a module was loaded comes again by an alarm, maybe while a worker of a
    dataset starts, which then is half started and prints a traceback."""
    from mitsuba_endo.cli.entry import interrupt_after_loading
    from mitsuba_endo.interrupts import uninterrupted

    def block() -> None:
        with uninterrupted():
            signal.raise_signal(signal.SIGALRM)
            reached.append(True)

    before, reached = signal.signal(signal.SIGALRM, interrupt_after_loading), []
    try:
        with pytest.raises(KeyboardInterrupt):
            block()
    finally:
        signal.signal(signal.SIGALRM, before)
    assert reached


@pytest.mark.parametrize("way", ["__del__", "weak dictionary"])
def test_an_interrupt_while_an_object_goes_is_not_lost(way: str):
    """Python prints what is raised there, and goes on. Oracle: the interrupt comes, afterwards."""
    code = WHILE_AN_OBJECT_GOES.replace("WAY", way)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "interrupted\n", done
    assert done.stderr == ""


WHILE_AN_OBJECT_GOES = """
import signal, sys, time, weakref
from mitsuba_endo.cli.entry import interrupt_after_loading
signal.signal(signal.SIGINT, interrupt_after_loading)
signal.signal(signal.SIGALRM, interrupt_after_loading)

class Thing:
    def __del__(self):
        if "WAY" == "__del__":
            signal.raise_signal(signal.SIGINT)

def strike(frame, event, argument):
    if frame.f_code.co_filename == weakref.__file__ and frame.f_code.co_name == "remove":
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)

thing, kept = Thing(), weakref.WeakValueDictionary()
kept["a"] = thing
try:
    if "WAY" != "__del__":
        sys.setprofile(strike)
    del thing
    time.sleep(5)
    print("lost")
except KeyboardInterrupt:
    print("interrupted")
"""
