"""Degenerate data: whether the solution says what it cannot know. 1 = said so.

A box is measured at several depths of its relief, each with fresh noise a number of times: is it
called weak where it is, and is what is called measured right by the stated deviation?
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Projector, Rig, Share
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.solve.calibrate import calibrate

from .report import Figure

sys.path.insert(0, str(Path(__file__).parents[2]))  # analytic surfaces that share no code with it
from tests.rigs import Surface, bumpy_sheet, cast, lopsided_camera, plane

NAME = "verdicts"
_figure = partial(Figure, NAME)
SIZE, CENTRE, FOCAL, NOISE_PX = (512, 400), (262.0, 189.0), 470.0, 0.2
POSE = RigidTransform.of([0.03, -0.12, 0.05], [-6.0, 1.0, 1.5])
AHEAD = RigidTransform.of([0.1, -0.05, 0.02], [-1.5, 0.8, 5.5])
"""Along the optical axis, where depth rejects neither pose of a plane."""
FACES = [((0.2, -0.1, 1.0), 70.0), ((1.0, 0.0, 0.35), 75.0), ((0.05, 1.0, 0.4), 80.0)]
"""Normals and distances of a box's faces."""
PLANE = plane(*FACES[0])
DEPTHS = {"deep box, 6.2 mm RMS": 1.0, "shallow box, 0.56 mm RMS": 0.1,
          "flat box, 0.16 mm RMS": 0.03}  # fmt: skip
"""Share of the box's relief; its distance from the nearest plane."""


def run(quick: bool) -> list[Figure]:
    """Solve each case with 0.2 px of noise."""
    width = 108 if quick else 160
    relief = bumpy_sheet(70.0, (0.15, -0.1), 6.0, 3)
    flat = _solved("pinhole", PLANE, width)
    centre = _solved("pinhole", relief, width, Share(centre="shared"))
    cosine = _solved("direction_cosine", PLANE, width)
    twice = _solved("pinhole", relief, width, frames=2)
    ahead = _solved("direction_cosine", PLANE, width, pose=AHEAD)
    return [
        _said("pinhole + plane: focal length not measured", _focal_unknown(flat)),
        _said("pinhole + free centre: focal length or centre not measured",
              _focal_unknown(centre) or centre.projector.centre.status != "measured"),
        _figure("direction cosine + plane: focal error", _error(cosine), "%", "lower", 1),
        _said("direction cosine + plane: twin pose rejected by depth", not cosine.alternatives),
        _said("direction cosine + plane ahead: twin pose listed, pose not measured",
              bool(ahead.alternatives)
              and ahead.frames[0].projector_from_camera.status != "measured"),
        _said("two identical frames: no more than one",
              any("no more information than one" in w for w in twice.warnings)),
        *(f for name, share in DEPTHS.items() for f in _of_box(name, share, width, quick)),
    ]  # fmt: skip


def _of_box(name: str, share: float, width: int, quick: bool) -> list[Figure]:
    """Measure a box again and again; weak is what is not called measured."""
    found = [_solved("pinhole", box(share), width, seed=k) for k in range(3 if quick else 20)]
    known = [s for s in found if s.projector.focal.status == "measured"]
    z = np.array([_error(s) / _std(s) for s in known])
    weak = [_focal_unknown(s) or s.frames[0].projector_from_camera.status != "measured"
            for s in found]  # fmt: skip
    return [
        _figure(f"{name}: pose or focal length called weak or worse", 100 * float(np.mean(weak)),
                "%", "higher" if share < 1 else "lower", 95 if share < 1 else 5),
        _figure(f"{name}: focal length called measured", 100 * len(known) / len(found), "%", ""),
        _figure(f"{name}: stated deviation of the focal length, median",
                float(np.median([_std(s) for s in found])), "%", ""),
        *([_figure(f"{name}: error over it where measured, RMS", float(np.sqrt(np.mean(z**2))), "",
                   "lower", 1.5)] if len(z) else []),
    ]  # fmt: skip


def box(share: float) -> Surface:
    """Return the range to the nearest of three faces, flattened towards the first by ``share``."""
    first = np.array(FACES[0][0]) / np.linalg.norm(FACES[0][0])
    bent = []
    for normal, distance in FACES:
        n = first + share * (np.array(normal) / np.linalg.norm(normal) - first)
        bent.append(plane((n[0], n[1], n[2]), 70 + share * (distance - 70)))
    return lambda rays: np.nanmin([p(rays) for p in bent], axis=0)


def _said(name: str, said: bool) -> Figure:
    return _figure(name, float(said), "", "higher", 1)


def _focal_unknown(solution: Solution) -> bool:
    return solution.projector.focal.status in ("weak", "unobservable")


def _error(solution: Solution) -> float:
    """Return the error of the focal length, %; infinite where none is given."""
    focal = solution.projector.focal.value
    return 100 * abs(focal / FOCAL - 1) if isinstance(focal, float) else np.inf


def _std(solution: Solution) -> float:
    std = solution.projector.focal.std
    return 100 * std / FOCAL if isinstance(std, float) else np.inf


def _solved(
    law: str, surface: Surface, width: int, share: Share | None = None, *,
    frames: int = 1, pose: RigidTransform = POSE, seed: int = 5,
) -> Solution:  # fmt: skip
    camera, rng = lopsided_camera(width, width * 7 // 9), np.random.default_rng(seed)
    seen = cast(camera, projector_model(law, FOCAL, CENTRE), SIZE, pose, surface)
    maps = [
        CorrespondenceMap(
            (seen.q + NOISE_PX * rng.standard_normal(seen.q.shape)).astype(np.float32), f"frame {k}"
        )
        for k in range(frames)
    ]
    projector = Projector(law=law, width=SIZE[0], height=SIZE[1], centre=list(CENTRE))
    rig = Rig(camera=Camera.from_model(camera), projector=projector, share=share or Share())
    return calibrate(maps, rig).solution
