"""The scenes of the experiments."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.evaluate.depth import RayCaster
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_from_vector
from mitsuba_endo.shapes import Colon, Polyp, PolypTruth, make_shape
from mitsuba_endo.shapes.mesh import Mesh

from .capture import Truth, in_channel, pinhole_camera, wandering

SIZE, CENTRE = (512, 512), (255.5, 255.5)
PROJECTOR = RigidTransform.of([0.03, -0.1, 0.05], [-6.0, 1.0, 1.5])
"""projector_from_camera of the first frame: 6.3 mm beside the camera and turned by 7 degrees."""
FOCAL = 330.0


def stomach_mesh(seed: int) -> Mesh:
    """Return the stomach phantom at the working distance of an endoscope, 50 mm."""
    return make_shape(
        "stomach", seed=seed, distance=50.0, radius=60.0, angle_x=0.95, angle_y=0.9,
        fold_spacing=15.0, furrow_width=4.0, fold_depth=5.5,
    )  # fmt: skip


def views_of(
    mesh: Mesh,
    frames: int,
    seed: int,
    *,
    law: str,
    width: int,
    play: float,
    baseline: float = 1.0,
) -> Truth:
    """Return ``frames`` views of a mesh from places some 4 mm and 3.5 degrees apart.

    Args:
        mesh: in the first camera's frame.
        frames: number of views.
        seed: of the places.
        law: of the projector.
        width: of the image, camera pixels.
        play: of the projector in its channel, see :func:`in_channel`.
        baseline: multiplies the first frame's, 6.3 mm.
    """
    rng = np.random.default_rng(seed)
    first = RigidTransform(PROJECTOR.R, baseline * PROJECTOR.t)
    return Truth(
        mesh, pinhole_camera(width, round(0.88 * width), 0.6), projector_model(law, FOCAL, CENTRE),
        SIZE, wandering(frames, rng, 0.06, [4.0, 4.0, 2.0]), in_channel(frames, rng, first, play),
    )  # fmt: skip


def sphere_mesh() -> Mesh:
    """Return the inside of a sphere that fills every view, 70 mm away at its deepest."""
    return make_shape("concave_sphere", angle_x=1.3, angle_y=1.2, edge=1.0)


def colon_mesh(seed: int) -> Mesh:
    """Return a colon seen along its axis."""
    return make_shape("colon", seed=seed)


def rabbit_mesh() -> Mesh:
    """Return the rabbit in front of a wall, as on a table: the solver gets no outline."""
    rabbit, wall = make_shape("rabbit", distance=50.0), make_shape("plane", distance=70.0)
    return Mesh(
        np.concatenate([rabbit.vertices, wall.vertices]),
        np.concatenate([rabbit.faces, wall.faces + len(rabbit.vertices)]),
    )


@dataclass(frozen=True, eq=False)
class PolypView:
    """A polyp in the colon, looked at, and the circle that a user draws around it."""

    truth: Truth
    diameter: float
    """mm"""
    middle: NDArray[np.float64]
    """(2,) of the circle, camera pixels."""
    outline: float
    """Radius of the circle, camera pixels."""


def polyp_view(seed: int, width: int) -> PolypView:
    """Return a sessile polyp of 5 to 15 mm, 20 to 32 mm away, up to 50 degrees from its axis.

    Between the folds of a colon that is full of air; the camera is near the middle of the lumen
    and sees the top of the polyp. The circle is up to 35 % too large and some 10 % off.
    """
    rng = np.random.default_rng(seed)
    diameter = rng.uniform(5, 15)
    polyp = Polyp(
        along=rng.uniform(30, 55), angle=rng.uniform(0, 2 * np.pi), diameter=diameter,
        height=diameter * rng.uniform(0.35, 0.5),
    )  # fmt: skip
    colon = Colon(seed=seed, fold_spacing=34.0, fold_depth=6.0, polyps=(polyp,))
    mesh, stands = colon.mesh(), colon.polyp_truth()[0]
    world_from_camera = _look_at(stands, mesh, rng)
    camera_from_world = world_from_camera.inverse()
    camera = pinhole_camera(width, round(0.88 * width), 0.7)
    truth = Truth(
        Mesh(camera_from_world.apply(mesh.vertices), mesh.faces), camera,
        projector_model("direction_cosine", FOCAL, CENTRE), SIZE, [RigidTransform.identity()],
        [PROJECTOR],
    )  # fmt: skip
    middle = camera_from_world.apply((stands.base + stands.height / 2 * stands.normal)[None])
    radius = float(camera.K[0, 0] * diameter / 2 / middle[0, 2])
    drawn = radius * rng.uniform(1.0, 1.35)
    return PolypView(truth, diameter, camera.project(middle)[0] + rng.normal(0, 0.1 * radius, 2),
                     drawn)  # fmt: skip


def _look_at(polyp: PolypTruth, mesh: Mesh, rng: np.random.Generator) -> RigidTransform:
    """Return world_from_camera of a camera that sees the polyp's top, as its projector does."""
    backend.ensure()
    caster = RayCaster(mesh.vertices, mesh.faces)
    top = polyp.base + polyp.height * polyp.normal
    for _ in range(500):
        side = np.cross(polyp.normal, rng.normal(size=3))
        side /= np.linalg.norm(side)
        tilt = np.radians(rng.uniform(10, 50))
        eye = top + rng.uniform(20, 32) * (np.cos(tilt) * polyp.normal + np.sin(tilt) * side)
        way = (top - eye) / np.linalg.norm(top - eye)
        right = np.cross([0.0, 1.0, 0.0], way)
        right /= np.linalg.norm(right)
        facing = np.column_stack([right, np.cross(way, right), way])
        turn = rotation_from_vector([*rng.normal(0, 0.12, 2), rng.normal(0, 0.5)])
        pose = RigidTransform.of(facing @ turn, eye)
        lamp = (pose @ PROJECTOR.inverse()).t
        if all(_sees(caster, device, top) for device in (eye, lamp)):
            return pose
    raise RuntimeError("no place from which the polyp is seen")


def _sees(caster: RayCaster, device: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """Tell whether a device is 4 mm from every wall and sees the point."""
    way = point - device
    distance = float(np.linalg.norm(way))
    around = np.concatenate([np.eye(3), -np.eye(3)])
    ranges = caster.range(device, np.concatenate([(way / distance)[None], around]))
    return bool(ranges[0] > distance - 0.5 and np.nanmin(ranges[1:]) > 4.0)
