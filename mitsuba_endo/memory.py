"""How much memory the process may still ask for, where the system sets it a limit."""

import contextlib
from pathlib import Path

_STATM = Path("/proc/self/statm")


def left() -> int | None:
    """Return the bytes of address space that are left under ``ulimit -v``; None without a limit.

    Linux tells; elsewhere None.
    """
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        most, _ = resource.getrlimit(resource.RLIMIT_AS)
        if most != resource.RLIM_INFINITY:
            pages = int(_STATM.read_text(encoding="ascii").split()[0])
            return most - pages * resource.getpagesize()
    return None


def limit_to(more: int) -> None:
    """Let the process ask for so many more bytes of address space, and no more. Linux only."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        pages = int(_STATM.read_text(encoding="ascii").split()[0])
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more, hard))
