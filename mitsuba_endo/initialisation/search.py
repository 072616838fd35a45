"""The default start: a search over focal length and relative pose that needs no guess."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel

from .choose import Minimum, RefinementProblem, finish, refine, robust_scale
from .correspondences import (
    PROPOSE_POINTS,
    REFINE_POINTS,
    Correspondences,
    checked_map,
    gather,
    spread_sample,
)
from .depth_image import depth_image
from .epipolar_refinement import evaluate
from .notes import remarks
from .outlier_rejection import clean_map, noise_scale
from .relative_pose_ransac import distinct, focal_lengths, propose
from .result import Start

FINISH_POINTS = 40_000
"""Correspondences on which the best minima are finished. Chosen."""
CANDIDATES = 8
"""Distinct proposals that are refined. Chosen."""
MAX_SCALE = 0.02
"""Residuals above this share of the pattern's width mean that no calibration was found."""
MIN_EXTENT_PX = 2.0
"""Pattern pixels that a map must span: one that was normalised to 0..1 spans one."""


def search_start(
    q: NDArray[np.floating],
    camera: CameraModel,
    projector: ProjectorModel,
    size: tuple[int, int],
    *,
    refine_focal: bool = True,
    focal_guess: float | None = None,
    seed: int = 0,
) -> Start:
    """Find projector pose, focal length and depth from one correspondence map.

    Steps: clean the map; propose poses for a ladder of focal lengths by five-point RANSAC and
    homographies; refine the distinct best under a Cauchy loss of falling scale; choose by cost
    among those with positive depth; finish under a redescending loss; triangulate.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
        camera: the camera that saw the map.
        projector: law, centre, aspect and distortion; its focal length is used only where
            ``refine_focal`` is False and no guess is given.
        size: pattern width and height, pixels.
        refine_focal: search the focal length; False keeps it fixed.
        focal_guess: with ``refine_focal`` one more focal length to propose, else its fixed value.
        seed: of the samples drawn.

    Raises:
        InputError: fewer than 50 usable correspondences, a map that spans less than 2 pattern
            pixels, no calibration with consistent depth and small residuals, a map and camera of
            different size, or a fixed focal length that is not positive.
    """
    rng = np.random.default_rng(seed)
    q = checked_map(q, camera)
    _check_focal(projector, refine_focal, focal_guess)

    usable = clean_map(q)
    data = gather(q, usable, camera)
    _check_extent(data)
    few = spread_sample(data, PROPOSE_POINTS, camera.width, rng)
    some = spread_sample(data, REFINE_POINTS, camera.width, rng)
    many = spread_sample(data, FINISH_POINTS, camera.width, rng)

    focals, bounds = focal_lengths(projector, size[0], few, refine_focal, focal_guess)
    proposals = distinct(propose(few, projector, focals), CANDIDATES)
    noise = noise_scale(q, usable)
    problem = RefinementProblem(projector, refine_focal, bounds, noise)
    minima = refine(problem, ((p.pose, p.focal) for p in proposals), some)
    minima = finish(problem, minima, some, many) if minima else []
    _check_found(minima, size)
    best = minima[0].state
    shape = (camera.height, camera.width)
    image = depth_image(evaluate(best.pose, best.projector, data), data, shape)
    return Start(
        projector=best.projector,
        projector_from_camera=best.pose,
        depth=image.depth,
        used=image.used,
        scale_px=robust_scale(best),
        noise_px=noise,
        notes=remarks(minima, many, refine_focal),
        alternatives=[m.candidate for m in minima[1:]],
    )


def _check_found(minima: list[Minimum], size: tuple[int, int]) -> None:
    todo = "check camera, projection model and centre, and that the map is in pattern pixels"
    if not minima:
        raise InputError(
            "no projector pose puts the correspondences in front of camera and projector",
            todo=todo,
        )
    scale = robust_scale(minima[0].state)
    if scale > MAX_SCALE * size[0]:
        raise InputError(
            f"the best projector pose leaves epipolar residuals of {scale:.3g} pattern pixels",
            todo=todo,
        )


def _check_extent(data: Correspondences) -> None:
    low, high = data.q.min(1), data.q.max(1)
    if (high - low).max() < MIN_EXTENT_PX:
        raise InputError(
            f"the correspondences span only {np.round(high - low, 3).tolist()} pattern pixels",
            todo="give q in pattern pixels, not normalised to 0..1",
        )


def _check_focal(projector: ProjectorModel, refine_focal: bool, guess: float | None) -> None:
    given = projector.focal if guess is None else guess
    needed = guess is not None or not refine_focal
    if needed and (given is None or not (np.isfinite(given) and given > 0)):
        raise InputError(
            f"focal length {given} is not a positive number",
            todo="give it in pattern pixels, or let the search find it",
        )
