"""Degenerate data: whether the solution says what it cannot know. 1 = said so."""

import sys
from functools import partial
from pathlib import Path

import numpy as np

from mitsuba_endo.geometry.laws import projector_model
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
PLANE = plane((0.2, -0.1, 1.0), 70.0)


def run(quick: bool) -> list[Figure]:
    """Solve each case with 0.2 px of noise."""
    width = 108 if quick else 160
    relief = bumpy_sheet(70.0, (0.15, -0.1), 6.0, 3)
    flat = _solved("pinhole", PLANE, width)
    centre = _solved("pinhole", relief, width, Share(centre="shared"))
    cosine = _solved("direction_cosine", PLANE, width)
    box = _solved("pinhole", _box, width)
    twice = _solved("pinhole", relief, width, frames=2)
    return [
        _said("pinhole + plane: focal length not measured", _focal_unknown(flat)),
        _said("pinhole + free centre: focal length or centre not measured",
              _focal_unknown(centre) or centre.projector.centre.status != "measured"),
        _figure("direction cosine + plane: focal error", _error(cosine), "%", "lower", 1),
        # Three planes fix the essential matrix and with it the focal length: how well, depends.
        _figure("box of planes: focal length weak or worse", float(_focal_unknown(box)), "", ""),
        _figure("box of planes: error over stated deviation", _error(box) / _std(box), "", "lower",
                3),
        _figure("box of planes: stated deviation of the focal length", _std(box), "%", ""),
        _said("two identical frames: no more than one",
              any("no more information than one" in w for w in twice.warnings)),
    ]  # fmt: skip


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


def _box(rays: np.ndarray) -> np.ndarray:
    """Return the range to the nearest of three planes."""
    planes = (PLANE, plane((1.0, 0.0, 0.35), 75.0), plane((0.05, 1.0, 0.4), 80.0))
    return np.nanmin([p(rays) for p in planes], axis=0)


def _solved(
    law: str, surface: Surface, width: int, share: Share | None = None, frames: int = 1
) -> Solution:
    camera, rng = lopsided_camera(width, width * 7 // 9), np.random.default_rng(5)
    seen = cast(camera, projector_model(law, FOCAL, CENTRE), SIZE, POSE, surface)
    maps = [
        CorrespondenceMap(
            (seen.q + NOISE_PX * rng.standard_normal(seen.q.shape)).astype(np.float32), f"frame {k}"
        )
        for k in range(frames)
    ]
    projector = Projector(law=law, width=SIZE[0], height=SIZE[1], centre=list(CENTRE))
    rig = Rig(camera=Camera.from_model(camera), projector=projector, share=share or Share())
    return calibrate(maps, rig).solution
