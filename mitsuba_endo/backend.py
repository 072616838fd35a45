"""Starting Mitsuba: finds LLVM, sets threads, registers the plugins, chooses a variant.

Entry points call :func:`use` first. Dr.Jit reads ``DRJIT_LIBLLVM_PATH`` once, when it is imported,
so the library is looked for before that; importing the package itself starts nothing.
"""

import ctypes
import importlib.metadata
import os
import sys
from pathlib import Path

from . import memory
from .errors import InputError

LLVM_PACKAGE = "karellen-llvm-core"
MINIMUM_LLVM = (17,)
"""Major version: kernels of Dr.Jit abort under older ones at the first minimum or clip."""
VARIANTS = ("cuda_ad_rgb", "llvm_ad_rgb")
LEAST_MEMORY = 512 << 20
"""Bytes of address space: Mitsuba and LLVM take 220 MiB to start, kernels come on top."""
_starters: set[int] = set()
"""Numbers of processes in which Mitsuba was started: this one, and those it was forked from."""


def use(*variants: str) -> str:
    """Load Mitsuba with the first usable of ``variants`` and return its name.

    Without arguments: CUDA where there is a GPU, LLVM elsewhere. Plugins stay registered however
    often the variant changes afterwards.

    Raises:
        InputError: Dr.Jit was imported before LLVM could be pointed out, or no usable LLVM.
        MemoryError: the system leaves the process less than they need.
    """
    todo = _advice()
    free = memory.left()
    if free is not None and free < LEAST_MEMORY:  # LLVM would end the process by a signal
        raise MemoryError(f"{free >> 20} MiB of address space are left for Mitsuba")
    locate_llvm()
    import mitsuba as mi

    from . import plugins

    plugins.register_all()
    try:
        mi.set_variant(*(variants or VARIANTS))
    except (ImportError, RuntimeError) as error:
        raise InputError(f"Mitsuba cannot start ({_first_line(error)})", todo=todo) from error
    variant = mi.variant()
    assert variant is not None  # set_variant has just succeeded
    if variant.startswith("llvm"):
        _check_llvm(todo)
    _set_threads()
    _quieten()
    _starters.add(os.getpid())
    return variant


def ensure() -> str:
    """Return the active variant, starting Mitsuba with the default ones if none is active.

    Raises:
        InputError: it was started in the process that this one was forked from. Its threads are
            not there: a rendering would never end.
    """
    if _starters - {os.getpid()}:
        raise InputError(
            "was started before this process was forked from its parent, and cannot render here",
            "Mitsuba", "start processes with multiprocessing.get_context('spawn')",
        )  # fmt: skip
    return _active()


def _active() -> str:
    mi = sys.modules.get("mitsuba")
    variant = mi.variant() if mi else None
    if variant is None:
        return use()
    from . import plugins

    plugins.ensure_registered()  # the caller may have chosen the variant without us
    return variant


def ensure_vectorised() -> str:
    """Return the active variant if it works on arrays, starting Mitsuba if none is active.

    Raises:
        InputError: a scalar variant is active.
    """
    variant = ensure()
    if variant.startswith("scalar"):
        raise InputError(
            f"has the variant {variant} active, which renders no coordinates", "Mitsuba",
            "call mitsuba_endo.backend.use() first",
        )  # fmt: skip
    return variant


def ensure_derivatives() -> str:
    """Return the active variant if it has derivatives, starting Mitsuba if none is active.

    Raises:
        InputError: another variant is active: what was made under it would be lost by a switch.
    """
    variant = _active()  # the solver renders nothing, and so works in a forked process too
    if variant not in VARIANTS:
        raise InputError(
            f"has the variant {variant} active, which the solver cannot use", "Mitsuba",
            "call mitsuba_endo.backend.use() first",
        )  # fmt: skip
    return variant


def locate_llvm() -> Path | None:
    """Set ``DRJIT_LIBLLVM_PATH`` to the LLVM library of the installed wheel; return its path.

    A path set by the user is respected; None means that Dr.Jit will search the system.
    """
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return Path(os.environ["DRJIT_LIBLLVM_PATH"])
    library = _wheel_library("libLLVM")
    if library is None:
        return None
    _preload_libcxx()
    os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    return library


def _wheel_library(stem: str) -> Path | None:
    try:
        files = importlib.metadata.files(LLVM_PACKAGE) or []
    except importlib.metadata.PackageNotFoundError:
        return None
    libraries = [
        Path(str(f.locate())) for f in files if f.name.startswith(stem) and ".so" in f.name
    ]
    # The versioned file is real; its symlinks appear only at the first interpreter start.
    existing = sorted({p.resolve() for p in libraries if p.exists()})
    return existing[0] if existing else None


def _preload_libcxx() -> None:
    """Load the wheel's C++ runtime, whose symlinks a read-only environment never gets.

    Locally: made global, its unwinder would catch Mitsuba's exceptions and crash the process.
    The loader finds a library that is already there by its name either way.
    """
    for stem in ("libunwind", "libc++abi", "libc++"):
        library = _wheel_library(f"{stem}.so")
        if library is not None:
            try:
                ctypes.CDLL(str(library), mode=ctypes.RTLD_LOCAL)
            except OSError:
                return  # LLVM then says itself what it misses


def _advice() -> str:
    """Return what to do if Mitsuba does not start."""
    if "drjit" in sys.modules and "DRJIT_LIBLLVM_PATH" not in os.environ:
        return "call mitsuba_endo.backend.use() before anything imports mitsuba or drjit"
    return "run `mitsuba-endo doctor`"


def _check_llvm(todo: str) -> None:
    """Refuse an LLVM that would abort the process at the first minimum or clip."""
    import drjit as dr

    version = dr.detail.llvm_version()
    if tuple(version) < MINIMUM_LLVM:
        raise InputError(
            f"LLVM {'.'.join(map(str, version))} is too old for Dr.Jit",
            "DRJIT_LIBLLVM_PATH",
            todo,
        )


def _quieten() -> None:
    """Leave out Dr.Jit's own lines about kernels that it could not keep on a full disk.

    They change no result, and whoever asked has a sentence of ours about the disk.
    """
    import drjit as dr

    dr.set_log_level(dr.LogLevel.Error)


def _set_threads() -> None:
    """Give Dr.Jit at least two threads: with one, reading and writing EXR files deadlocks."""
    import drjit as dr

    if dr.thread_count() < 2:
        dr.set_thread_count(2)


def _first_line(error: BaseException) -> str:
    return str(error).strip().splitlines()[0].rstrip(".") if str(error).strip() else repr(error)
