"""Four photographs of one surface together: decoded, refined, calibrated jointly."""

from collections.abc import Iterator
from functools import partial

from mitsuba_endo.decoding.grid.decode import decode_image
from mitsuba_endo.decoding.network import Network
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.refine.refine_map import refine_map

from .decoder_end_to_end import FRAMES, calibrated_jointly, shoot_frames
from .decoder_scenes import PATTERN, Kind
from .report import Figure

SEED = 11
"""Of ``decoder_end_to_end``, whose figures are those without refinement."""
_figure = partial(Figure, "image")


def joint_figures(network: Network, quick: bool) -> Iterator[Figure]:
    """Yield what four frames of a colon and of a stomach reach together."""
    kinds: tuple[Kind, ...] = ("colon", "stomach")
    for kind in kinds:
        mesh, shots = shoot_frames(kind, SEED, quick)
        maps = []
        for k, shot in enumerate(shots):
            image = shot.image(False, k)[0]
            found = decode_image(image, network, PATTERN)
            decoded = CorrespondenceMap(found.q, "", found.weight)
            maps.append(refine_map(decoded, image, grid_image(PATTERN)).map)
        focal, shape, frames = calibrated_jointly(mesh, shots, maps)
        name = f"{kind}, {FRAMES} frames together, refined"
        yield _figure(f"{name}: shape RMSE", shape, "mm", "lower", 0.25)
        yield _figure(f"{name}: focal error", focal, "%", "lower", 0.03)
        yield _figure(f"{name}: frames used", frames, f"of {FRAMES}", "higher", FRAMES)
