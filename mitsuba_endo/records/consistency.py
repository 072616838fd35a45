"""Whether correspondence maps and a rig belong together, asked before any work is done."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError, shown
from .correspondence import CorrespondenceMap, check_covariance
from .rig import Rig

MIN_CORRESPONDENCES = 50
"""With fewer, the pose, the focal length and a surface cannot be told from noise."""
MIN_SHARE_ON_PATTERN = 0.5
"""Outliers and a wrong centre leave more than this on the pattern; wrong units do not."""


def as_maps(maps: Iterable[CorrespondenceMap]) -> list[CorrespondenceMap]:
    """Return maps that were given from Python as a list, if they are maps.

    Raises:
        InputError: a single map, a path, something else than maps in it, or arrays of another
            shape or type than a map's.
    """
    if isinstance(maps, CorrespondenceMap | str | Path) or not isinstance(maps, Iterable):
        raise InputError(
            f"is {shown(type(maps).__name__)} and no list", "maps", "give [load_map(path), ...]"
        )
    correspondences = list(maps)
    for k, map_ in enumerate(correspondences):
        if not isinstance(map_, CorrespondenceMap):
            what = f"is {shown(type(map_).__name__)} and no map"
            raise InputError(what, f"maps[{k}]", "give [load_map(path), ...]")
        _check_arrays(map_)
    return correspondences


def _check_arrays(map_: CorrespondenceMap) -> None:
    q, weight, covariance = map_.q, map_.weight, map_.covariance
    if not _is_numbers(q) or q.ndim != 3 or q.shape[2] != 2:
        form = getattr(q, "shape", type(q).__name__)
        raise InputError(f"q is {form}, not (H, W, 2) numbers", f"{map_.name}: map", "mend it")
    if covariance is not None:
        if not _is_numbers(covariance) or covariance.shape != (*q.shape[:2], 3):
            form = getattr(covariance, "shape", type(covariance).__name__)
            what = f"covariance is {form}, not (H, W, 3) numbers"
            raise InputError(what, f"{map_.name}: map", "mend it")
        valid_covariance = np.where(map_.valid[..., None], covariance, np.nan)
        check_covariance(valid_covariance, q, f"{map_.name}: map")
    if weight is None:
        return
    if not _is_numbers(weight) or weight.shape != q.shape[:2]:
        form = getattr(weight, "shape", type(weight).__name__)
        raise InputError(f"weight is {form}, not (H, W) numbers", f"{map_.name}: map", "mend it")
    if not (weight[map_.valid] >= 0).all():
        raise InputError(
            "weight is negative or missing where the map has a coordinate", f"{map_.name}: map",
            "give 0 where nothing is known",
        )  # fmt: skip


def _is_numbers(array: object) -> bool:
    return isinstance(array, np.ndarray) and array.dtype.kind in "fiu"


def check_maps(maps: Sequence[CorrespondenceMap], rig: Rig) -> None:
    """Refuse maps that cannot belong to the rig.

    Raises:
        InputError: no map, two frames of one name, map and camera of different size, no map
            without a :func:`fault`, or a known distance between points that are not in the maps;
            names the map and the rig's field.
    """
    if not isinstance(rig, Rig):
        what = f"is {shown(type(rig).__name__)} and no rig"
        raise InputError(what, "rig", "give load_rig(path)")
    if not maps:
        raise InputError("no correspondence map is given", todo="give at least one")
    names = [map_.name for map_ in maps]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise InputError("two frames have this name", twice[0], "rename one file")
    for map_ in maps:
        _check_size(map_, rig)
    faults = [fault(map_, rig) for map_ in maps]
    if faults[0] is not None and None not in faults:
        raise faults[0]
    _check_known_distance(maps, rig)


def fault(map_: CorrespondenceMap, rig: Rig) -> InputError | None:
    """Return what makes a map useless, or None: such a frame is left out if others are sound.

    A map has a fault if it has fewer than 50 correspondences, or coordinates mostly outside the
    pattern.
    """
    try:
        _check_count(map_)
        _check_units(map_, rig)
    except InputError as error:
        return error
    return None


def _check_size(map_: CorrespondenceMap, rig: Rig) -> None:
    height, width = map_.q.shape[:2]
    if (width, height) != (rig.camera.width, rig.camera.height):
        raise InputError(
            f"the map is {width} x {height} pixels and the rig's camera.width x camera.height "
            f"{rig.camera.width} x {rig.camera.height}",
            f"{map_.name}: map",
            "give the camera of the images that the map was made from",
        )


def _check_count(map_: CorrespondenceMap) -> None:
    count = int(map_.valid.sum())
    if count < MIN_CORRESPONDENCES:
        raise InputError(
            f"the map has {count} usable correspondences, fewer than {MIN_CORRESPONDENCES}",
            f"{map_.name}: map",
            "check how it was decoded",
        )


def _check_units(map_: CorrespondenceMap, rig: Rig) -> None:
    q = map_.q[map_.valid]
    size = np.array([rig.projector.width, rig.projector.height])
    share = ((q >= -0.5) & (q <= size - 0.5)).all(-1).mean()
    if share < MIN_SHARE_ON_PATTERN:
        raise InputError(
            f"only {100 * share:.0f} % of the projector coordinates lie on the pattern of "
            f"projector.width x projector.height = {size[0]} x {size[1]} pixels",
            f"{map_.name}: map",
            "give coordinates in pattern pixels and the pattern's size in the rig",
        )


def _check_known_distance(maps: Sequence[CorrespondenceMap], rig: Rig) -> None:
    distance = rig.scale.known_distance
    if distance is None:
        return
    if distance.frame >= len(maps):
        raise InputError(
            f"frame {distance.frame} does not exist, {len(maps)} maps are given and counted from 0",
            "scale.known_distance.frame",
            "name a frame that is given",
        )
    limits = np.array([rig.camera.width, rig.camera.height]) - 0.5
    pixels = np.array(distance.pixels)
    if not ((pixels >= -0.5) & (pixels <= limits)).all():
        raise InputError(
            f"the points {distance.pixels} do not both lie in the camera's image",
            "scale.known_distance.pixels",
            "give two (x, y) in camera pixels",
        )
