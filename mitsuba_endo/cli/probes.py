"""What ``doctor`` tries, each in a child process: ``python -m mitsuba_endo.cli.probes NAME``.

A library that does not fit can abort the process or wait for ever, which no exception handler
sees. A probe prints what it found on its last line, or raises.
"""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from .. import backend

GREY_OFF = 0.05
"""Of a brightness of 0.5, that the noise of 16 samples a pixel explains."""
COORDINATE_OFF = 1e-3
"""Pattern pixels, that single precision explains."""


def llvm() -> str:
    """Load LLVM as Dr.Jit will and compile the operation that LLVM 15 and 16 abort on."""
    backend.locate_llvm()
    import drjit as dr
    from drjit.llvm import Float

    library = os.environ.get("DRJIT_LIBLLVM_PATH", "found by Dr.Jit on the system")
    version = dr.detail.llvm_version()
    if version[0] < 0:
        raise RuntimeError(f"no LLVM library ({library})")
    text = f"LLVM {'.'.join(map(str, version))}, {library}"
    if tuple(version) < backend.MINIMUM_LLVM:
        raise RuntimeError(f"{text} is older than {backend.MINIMUM_LLVM[0]}")
    x = dr.clip(dr.arange(Float, 4), 1.0, 2.0)
    _expect(np.allclose(np.array(x), [1, 1, 2, 2]), "a compiled kernel returns wrong values")
    return text


def variant(name: str) -> str:
    """Render a lit square with one variant of Mitsuba."""
    backend.locate_llvm()
    import mitsuba as mi

    mi.set_variant(name)
    to_world = mi.ScalarTransform4f().look_at(origin=[0, 0, 3], target=[0, 0, 0], up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": 6, "height": 4, "rfilter": {"type": "box"}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": {"type": "perspective", "fov": 30, "to_world": to_world, "film": film},
            "shape": {"type": "rectangle"},
            "light": {"type": "constant"},
        }
    )
    mean = float(np.array(mi.render(scene, spp=16)).mean())
    # A grey diffuse surface (Mitsuba's default, reflectance 0.5) under uniform light of radiance 1.
    _expect(abs(mean - 0.5) < GREY_OFF, f"the test image is wrong (mean {mean:.3f})")
    return "renders"


def threads() -> str:
    """Ask how many threads Dr.Jit uses after the package has set them."""
    backend.use()
    import drjit as dr

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    _expect(dr.thread_count() >= 2, "Dr.Jit has one thread, with which EXR files deadlock")
    return f"{dr.thread_count()} threads on {cores} usable cores"


def exr() -> str:
    """Write and read OpenEXR files with both libraries that the package uses."""
    backend.use()
    import mitsuba as mi

    from ..records.correspondence import load_map, save_map

    q = np.linspace(1, 50, 3 * 5 * 2, dtype=np.float32).reshape(3, 5, 2)
    q[1, 2] = np.nan
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.exr"
        save_map(path, q)
        same = np.array_equal(load_map(path).q, q, equal_nan=True)
        _expect(same, "OpenEXR returns other values than were written")
        mi.Bitmap(q[..., 0].copy()).write(str(Path(folder) / "image.exr"))
        back = np.array(mi.Bitmap(str(Path(folder) / "image.exr"))).squeeze()
        same = np.array_equal(back, q[..., 0], equal_nan=True)
        _expect(same, "Mitsuba reads other values than were written")
    return "written and read by OpenEXR and by Mitsuba"


def plugins() -> str:
    """Render projector coordinates of a plane, whose closed form is known, with our plugins."""
    name = backend.use()
    import mitsuba as mi

    pose = mi.ScalarTransform4f().look_at(origin=[0, 0, 3], target=[0, 0, 0], up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": 6, "height": 4, "rfilter": {"type": "box"}}
    projector = {"focal": 30.0, "width": 40, "height": 20, "to_world": pose}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "projector_coords"},
            "sensor": {"type": "endoscope", "fx": 12.0, "to_world": pose, "film": film},
            "projector": {"type": "doe_projector", **projector},
            "shape": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(9)},
        }
    )
    q = np.array(mi.render(scene))[..., :2]
    # Camera and projector coincide: q = centre + f (pixel - cx) / fx.
    y, x = np.mgrid[:4, :6]
    expected = np.stack([19.5 + 30 * (x - 2.5) / 12, 9.5 + 30 * (y - 1.5) / 12], -1)
    _expect(
        np.abs(q - expected).max() < COORDINATE_OFF, "projector coordinates of a plane are wrong"
    )
    return f"registered and rendered with {name}"


def _expect(condition: bool, otherwise: str) -> None:
    if not condition:
        raise RuntimeError(otherwise)


PROBES: dict[str, Callable[[], str]] = {
    "llvm": llvm,
    "llvm_ad_rgb": lambda: variant("llvm_ad_rgb"),
    "cuda_ad_rgb": lambda: variant("cuda_ad_rgb"),
    "scalar_rgb": lambda: variant("scalar_rgb"),
    "threads": threads,
    "exr": exr,
    "plugins": plugins,
}

if __name__ == "__main__":
    print(PROBES[sys.argv[1]]())
