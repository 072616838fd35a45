"""The centre of a projector's lens where nobody gave it, looked for before anything is solved."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...geometry.projection_models import Pinhole
from ...initialisation.lens_shift import (
    FrameSamples,
    LensShift,
    find_lens_shift,
    frame_samples,
    is_explained,
)
from ...initialisation.result import Start
from ...records.checkpoint import Checkpoint
from ...records.consistency import MIN_CORRESPONDENCES
from ...records.correspondence import CorrespondenceMap
from ...records.rig import Rig
from ..options import Options
from ..unknowns.layout import Layout
from .initial_poses import start_frame

MAX_FRAMES = 2
"""Frames that are looked at: each takes some 3 s, and one tells the height to a few pixels."""
_ACROSS = 0.005
"""Standard deviation of a lens's centre across, of the pattern's width: mounts and panels are
centred to some tenths of a millimetre in panels of 10 to 20 mm. The real rig of the benchmark has
0.002."""
_ASSUMED = (
    "projector.centre: not given, so it is assumed in the middle of the pattern, ({x:g}, {y:g}) "
    "px; of many projectors with a lens it lies at the lower edge or below, and a wrong one spoils "
    "focal length and pose; give it if it is known"
)
_FOUND = (
    "projector.centre: not given; ({x:.4g}, {y:.4g}) px was found along the pattern's height, at "
    "half of its width ({gain}), {then}; give it if it is known"
)
_AGAIN = "projector.centre: not given; the earlier calibration found another than the middle"
_THEN = {True: "from where it is refined", False: "and is kept as the plan asks"}
_GAIN = "residuals fall from {before:.2g} to {after:.2g} px"
_NO_POSE = "no pose is possible with the middle"


def centre_is_assumed(rig: Rig, law: str) -> bool:
    """Tell whether a centre must be assumed that may well be elsewhere.

    A diffractive projector's zero order is the middle of its pattern; a lens is often shifted.
    """
    return rig.projector.centre is None and law == Pinhole.name


def searched_centre(
    maps: Sequence[CorrespondenceMap],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    options: Options,
) -> tuple[Rig, str, dict[str, Start]]:
    """Look for the height of a projector's centre that was not given.

    Nothing is looked for where the start is not searched for either, nor where the middle explains
    the frames to their noise. What was found is a start, not a measurement: the plan lets it be
    refined unless it says otherwise.

    Args:
        maps: of all frames; those with most pixels are looked at.
        camera: which saw them.
        rig: without a centre of the projector, whose projection model is that of a lens.
        layout: of the unknowns.
        options: how to solve.

    Returns:
        The rig, with the centre where one was found; a sentence that says which is used; and the
        starts that the search came upon, of frames by name, as far as they belong to that centre.
    """
    projector, assumed = rig.projector, _assumed(rig)
    if projector.pose is not None or options.start != "search":
        return rig, assumed, {}
    most = sorted(maps, key=lambda m: -int(m.valid.sum()))
    looked_at = [m for m in most if m.valid.sum() >= MIN_CORRESPONDENCES][:MAX_FRAMES]
    starts = _starts(looked_at, camera, rig, layout, options)
    if len(starts) == len(looked_at) and all(is_explained(s) for s in starts.values()):
        return rig, assumed, starts
    frames = _samples(looked_at, camera, options.seed)
    if not frames:
        return rig, assumed, starts
    shift = find_lens_shift(
        frames, projector.to_model(Pinhole.name), (projector.width, projector.height),
        refine_focal=layout.free["focal"], focal_guess=projector.focal.value,
    )  # fmt: skip
    if not shift.off_middle:
        return rig, assumed, starts
    moved = _with_centre(rig, list(shift.centre))
    return moved, found_note(shift, refined=moved.share.centre != "fixed"), {}


def resumed_centre(checkpoint: Checkpoint, rig: Rig) -> tuple[Rig, str]:
    """Return the rig with the centre of an earlier calibration, and a sentence that says so."""
    centre = [float(c) for c in checkpoint.values["centre"][0]]
    if centre == rig.projector.middle:
        return rig, _assumed(rig)
    return _with_centre(rig, centre), _AGAIN


def found_note(shift: LensShift, *, refined: bool) -> str:
    """Say where a centre was found, and by how much it is better than the middle."""
    before, after = shift.middle_scale_px, shift.scale_px
    gain = _GAIN.format(before=before, after=after) if np.isfinite(before) else _NO_POSE
    x, y = shift.centre
    return _FOUND.format(x=x, y=y, gain=gain, then=_THEN[refined])


def _assumed(rig: Rig) -> str:
    x, y = rig.projector.middle
    return _ASSUMED.format(x=x, y=y)


def _with_centre(rig: Rig, centre: list[float]) -> Rig:
    """Return the rig with a centre that was found, an unknown unless the plan says otherwise.

    One pair determines no more of it than its height (see :mod:`.lens_shift` of the
    initialisation): across, the middle is believed to what lenses keep it to.
    """
    share = rig.share.model_copy(update={"centre": rig.share.centre or "shared"})
    width, height = rig.projector.width, rig.projector.height
    std = rig.projector.centre_std or [_ACROSS * width, float(height)]
    projector = rig.projector.model_copy(update={"centre": centre, "centre_std": std})
    return rig.model_copy(update={"projector": projector, "share": share})


def _starts(
    maps: Sequence[CorrespondenceMap],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    options: Options,
) -> dict[str, Start]:
    """Return the starts, by name, of the frames that have one with the centre in the middle."""
    starts: dict[str, Start] = {}
    for map_ in maps:
        with suppress(InputError):  # told where this frame is started
            starts[map_.name] = start_frame(map_, camera, rig, layout, Pinhole.name, options)
    return starts


def _samples(
    maps: Sequence[CorrespondenceMap], camera: CameraModel, seed: int
) -> list[FrameSamples]:
    """Return samples of the frames that can be used at all."""
    samples: list[FrameSamples] = []
    for map_ in maps:
        with suppress(InputError):  # likewise
            samples.append(frame_samples(map_.q, camera, np.random.default_rng(seed)))
    return samples
