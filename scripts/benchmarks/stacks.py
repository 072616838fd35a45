"""Path-traced Gray-code and phase-shift stacks, decoded, against exact coordinates."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.capture.photograph import photograph
from mitsuba_endo.capture.settings import CaptureSettings, Light, Tissue
from mitsuba_endo.decoding.stack import Stack, decode_stack
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.synthetic import MeshScene

from .decoder_scenes import SIZE, camera, projector, surface
from .report import Figure

NAME = "stacks"
_figure = partial(Figure, NAME)
OWN = RigidTransform.of([0.03, -0.1, 0.05], [-5.8, 1.2, 1.6])
"""projector_from_camera, mm."""
POWER = 3000.0
"""Of a white pattern. A projector's pixel has one brightness, so an image with fewer white pixels
has less light in all; a DOE's power would be the same for all."""
TOP = 65535
BRIGHT = 0.9
"""Of full scale, of the brightest pixels under white light."""


def run(quick: bool) -> list[Figure]:
    """Photograph a bumpy sheet under three kinds of stacks."""
    size = (160, 120) if quick else (240, 180)
    plans = [
        StackPlan.make("gray", *SIZE, inverse=True),
        StackPlan.make("gray+phase", *SIZE),
        StackPlan.make("phase", *SIZE),
    ]
    return [figure for plan in plans for figure in _figures(plan, size, 8 if quick else 32)]


def _figures(plan: StackPlan, size: tuple[int, int], spp: int) -> list[Figure]:
    stack, q = capture(plan, size, spp)
    found = decode_stack(stack, plan)
    inside = np.isfinite(q[..., 0]) & ((q >= 0) & (q <= np.array(SIZE) - 1)).all(-1)
    error = np.abs(found.q - q)[inside & found.decoded]
    name = f"{plan.kind}, {len(stack.images)} images"
    return [
        _figure(f"{name}: error, median", float(np.median(error)), "px", "lower", 0.1),
        _figure(f"{name}: error, 95th percentile", float(np.quantile(error, 0.95)), "px", "lower"),
        _figure(f"{name}: coverage", 100 * float(found.decoded[inside].mean()), "%", "higher"),
    ]


def capture(plan: StackPlan, size: tuple[int, int], spp: int) -> tuple[Stack, NDArray[np.float64]]:
    """Return the stack as a 16-bit camera sees it, without noise of its own, and the truth."""
    mesh = surface("sheet", 1)
    place = (camera(np.random.default_rng(1), *size), RigidTransform.identity(), projector(), OWN)
    images = []
    for k, pattern in enumerate(patterns(plan)):
        light = (np.repeat(pattern[..., None], 3, axis=-1) / 255).astype(np.float32)
        share = float(light.mean())
        if share == 0:
            images.append(np.zeros(size[::-1], np.float32))
            continue
        settings = CaptureSettings(light=Light(projector_power=POWER * share), tissue=Tissue(),
                                   spp=spp)  # fmt: skip
        images.append(photograph(mesh, *place, light, settings, k).radiance[..., 1])
    bright = np.stack(images) * BRIGHT / float(np.quantile(images[0], 0.999))
    values = np.rint(np.clip(bright, 0, 1) * TOP) / np.float32(TOP)
    q = MeshScene(mesh.vertices, mesh.faces).view(*place).q
    return Stack(values.astype(np.float32), values >= 1, TOP), q
