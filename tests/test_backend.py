"""Starting Mitsuba."""

import subprocess
import sys

import pytest

from mitsuba_endo import backend
from mitsuba_endo.errors import InputError


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )


def test_importing_the_package_starts_nothing() -> None:
    """NumPy-only stages must not wait for a compiler to load."""
    names = ("backend", "geometry.projection_models", "shapes")
    modules = ", ".join(f"mitsuba_endo.{name}" for name in names)
    done = run(f"import sys, {modules}; print(sorted({{'mitsuba', 'drjit'}} & set(sys.modules)))")
    assert done.stdout.strip() == "[]", done.stderr


def test_exceptions_of_mitsuba_reach_python(llvm: str) -> None:
    """The LLVM wheel's C++ runtime must not catch Mitsuba's exceptions (it crashed the process)."""
    done = run(
        "from mitsuba_endo import backend; backend.use('llvm_ad_rgb')\n"
        "import mitsuba as mi\n"
        "try: mi.load_dict({'type': 'nonsense'})\n"
        "except RuntimeError as error: print('caught', 'nonsense' in str(error))"
    )
    assert done.stdout.strip() == "caught True", done.stderr


def test_use_falls_back_and_ensure_keeps_the_variant(llvm: str) -> None:
    """Oracle: the variant that is active afterwards."""
    import mitsuba as mi

    assert backend.use("llvm_ad_mono") == "llvm_ad_mono" == mi.variant()
    assert backend.ensure() == "llvm_ad_mono"
    assert backend.use("llvm_ad_rgb") == "llvm_ad_rgb"


def test_unknown_variant_is_refused(llvm: str) -> None:
    """One sentence that says where to look for help."""
    with pytest.raises(InputError, match="doctor"):
        backend.use("metal_ad_rgb")


def test_there_are_two_threads(llvm: str) -> None:
    """With one thread, EXR files deadlock."""
    import drjit as dr

    assert dr.thread_count() >= 2


def test_llvm_path_of_the_user_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the environment variable."""
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/opt/llvm/libLLVM.so")
    assert str(backend.locate_llvm()) == "/opt/llvm/libLLVM.so"


@pytest.mark.parametrize(
    "module", ["mitsuba_endo.rendering.moving_mesh", "mitsuba_endo.solve.calibrate"]
)
def test_modules_may_be_imported_before_use(module: str) -> None:
    """Importing a module that needs Dr.Jit must not let it pick another LLVM on the system."""
    expected = run(
        "from mitsuba_endo import backend; backend.use('llvm_ad_rgb')\n"
        "import drjit; print(drjit.detail.llvm_version())"
    )
    done = run(
        f"import {module}; from mitsuba_endo import backend; backend.use('llvm_ad_rgb')\n"
        "import drjit; print(drjit.detail.llvm_version())"
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == expected.stdout != ""


def test_drjit_imported_too_early_is_explained() -> None:
    """Oracle: the advice that helps when Dr.Jit found no LLVM by itself."""
    done = run(
        "import os; os.environ.pop('DRJIT_LIBLLVM_PATH', None)\n"
        "import drjit; drjit.detail.llvm_version = lambda: (15, 0, 6)\n"
        "from mitsuba_endo import backend\n"
        "backend.use('llvm_ad_rgb')"
    )
    assert done.returncode != 0
    assert "before anything imports mitsuba or drjit" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        ("render_capture(scene, spp=1)", "has the variant scalar_rgb active, which renders no"),
        ("backend.ensure_derivatives()", "has the variant scalar_rgb active, which the solver"),
    ],
)
def test_a_variant_chosen_before_the_package(llvm: str, call: str, expected: str) -> None:
    """Oracle: the plugins are there, so a scene loads; what a scalar variant cannot do is told."""
    done = run(
        "import mitsuba as mi; mi.set_variant('scalar_rgb')\n"
        "from mitsuba_endo import backend\n"
        "from mitsuba_endo.errors import InputError\n"
        "from mitsuba_endo.rendering.render import render_capture\n"
        "from mitsuba_endo.rendering.scene import load_scene\n"
        "scene = load_scene('sheet', width=64, height=48, fx=53, cx=31, cy=23)\n"
        f"try: {call}\n"
        "except InputError as error: print(error)"
    )
    assert expected in done.stdout, done.stderr
