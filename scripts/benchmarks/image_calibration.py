"""How right a calibration from one map of a photograph is: decoded, refined, read a second time."""

import json
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.files import atomic_path
from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.rounds.second_round import read_again
from mitsuba_endo.solve.calibrate import calibrate

from .decoder_scenes import FOCAL, PATTERN, Kind, Shot, compare, surface

GUESS = 1.1
"""The focal length's guess over the truth."""


@dataclass(frozen=True)
class Accuracy:
    """Errors of one calibration."""

    focal_percent: float
    """Of the focal length."""
    direction_deg: float
    """Of the projector's translation."""
    range_mm: float
    """Median over the pixels of the distance along rays."""


@dataclass(frozen=True)
class Calibrations:
    """Of one photograph, and what the second round made of its map."""

    decoded: Accuracy
    refined: Accuracy
    second: Accuracy
    """That of ``refined`` where the second round changed too little to solve again."""
    lit: int
    """Pixels lit, as in :func:`.decoder_scenes.compare`."""
    read: int
    """Of them, those with a coordinate after the second round."""
    wrong: int
    """Of those, those in a wrong period."""


FOLDER = Path("build/image_calibrations")
"""One file a photograph, so that a run that was stopped goes on. Ignored by git; remove the folder
after a change of decoder, refinement or solver."""
WRONG = 0.5
"""Periods."""


def all_calibrated(
    name: str, kind: Kind, seed: int, shot: Shot, visible: NDArray[np.bool_],
    image: NDArray[np.uint8], decoded: CorrespondenceMap, refined: CorrespondenceMap,
) -> Calibrations:  # fmt: skip
    """Calibrate from each map of a photograph, or read what an earlier run found.

    Args:
        name: of the photograph and its condition, a file's name.
        kind: of the surface.
        seed: of the photograph.
        shot: with the truth.
        visible: (H, W) pixels that are lit.
        image: (H, W, 3) the photograph.
        decoded: the decoder's map.
        refined: the same, refined.
    """
    path = FOLDER / f"{name}.json"
    if path.is_file():
        data = json.loads(path.read_text())
        of = {k: Accuracy(**data.pop(k)) for k in ("decoded", "refined", "second")}
        return Calibrations(**of, **data)
    plain, first = _solved(decoded, shot), _solved(refined, shot)
    again = read_again(first, [refined], [(refined.name, image)], grid_image(PATTERN))
    last = _solved(again.maps[0], shot) if again.worth_solving else first
    found = compare(again.maps[0].q, shot, visible)
    seen = decoded.valid
    of = (_accuracy(c, kind, seed, shot, seen) for c in (plain, first, last))
    wrong = int((found.error > WRONG).any(1).sum())
    out = Calibrations(*of, lit=found.lit, read=len(found.error), wrong=wrong)
    with atomic_path(path) as aside:
        aside.write_text(json.dumps(asdict(out)))
    return out


def _solved(map_: CorrespondenceMap, shot: Shot) -> Calibration:
    """Calibrate from one map, the baseline's length given."""
    rig = Rig(
        camera=Camera.from_model(shot.camera),
        projector=Projector(
            width=PATTERN.width, height=PATTERN.height, focal=Focal(value=GUESS * FOCAL)
        ),
        scale=Scale(baseline=float(np.linalg.norm(shot.projector_from_camera.t))),
    )
    return calibrate([map_], rig)


def _accuracy(
    found: Calibration, kind: Kind, seed: int, shot: Shot, seen: NDArray[np.bool_]
) -> Accuracy:
    """Compare with the truth, ranges over pixels (H, W) that all maps are judged on."""
    focal = found.solution.projector.focal.value
    pose = found.solution.frames[0].projector_from_camera
    t = np.asarray(np.ravel(pose.t), np.float64) if pose.t is not None else np.full(3, np.nan)
    vertices, faces = found.surface.vertices, found.surface.faces
    distance = range_image(RayCaster(np.asarray(vertices, float), np.asarray(faces)), shot.camera)
    error = np.abs(distance - _truth(kind, seed, shot))[seen]
    return Accuracy(
        100 * abs(focal / FOCAL - 1) if isinstance(focal, float) else np.nan,
        float(np.degrees(angle_between(t, shot.projector_from_camera.t))),
        float(np.nanmedian(error)),
    )


@cache
def _truth(kind: Kind, seed: int, shot: Shot) -> NDArray[np.float64]:
    mesh = surface(kind, seed)
    vertices = shot.world_from_camera.inverse().apply(np.asarray(mesh.vertices, np.float64))
    return range_image(RayCaster(vertices, np.asarray(mesh.faces)), shot.camera)
