"""The image of a matt plane under the coded grid, by formula instead of path tracing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.capture.settings import CaptureSettings, Effects, Light, Tissue
from mitsuba_endo.decoding.grid_pattern import COLOURS, CodedGrid
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel, projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.shapes import make_shape
from mitsuba_endo.shapes.mesh import Mesh

LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
"""Of linear sRGB (IEC 61966-2-1), by which the projector counts power."""


@dataclass(frozen=True, eq=False)
class PlaneUnderGrid:
    """An asymmetric set-up whose image has a closed form."""

    camera: CameraModel
    pose: RigidTransform
    """projector_from_camera."""
    projector: ProjectorModel
    grid: CodedGrid
    tissue: Tissue
    light: Light

    @property
    def mesh(self) -> Mesh:
        return make_shape(
            "plane", width=200, height=180, distance=60, tilt_x=0.15, tilt_y=-0.25, edge=10
        )

    def settings(self, spp: int) -> CaptureSettings:
        return CaptureSettings(
            tissue=self.tissue, light=self.light, effects=Effects(), spp=spp, max_depth=2
        )

    def radiance(self, samples: int = 4) -> NDArray[np.float64]:
        """Return (h, w, 3): the mean over ``samples``^2 places in each pixel.

        Radiance = intensity cos(incidence) / distance^2 times the diffuse reflectance of Burley
        2012 (section 5.3), which ``principled`` has at specular 0.
        """
        h, w = self.camera.height, self.camera.width
        offsets = (np.arange(samples) + 0.5) / samples - 0.5
        total = np.zeros((h, w))
        for dx in offsets:
            for dy in offsets:
                total += self._at(self.camera.pixel_grid() + np.array([dx, dy]))
        colour = np.array(COLOURS[self.grid.colour])
        return total[..., None] / samples**2 * colour * np.array(self.tissue.base_color)

    def _at(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        a, b, c = (self.mesh.vertices[self.mesh.faces[0, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        ray = self.camera.rays(pixels)
        points = ray * ((a @ normal) / (ray @ normal))[..., None]
        in_projector = self.pose.apply(points)
        distance = np.linalg.norm(in_projector, axis=-1)
        towards = -self.pose.inverse().rotate(in_projector / distance[..., None])
        cos_in, cos_out = np.abs(towards @ normal), np.abs(ray @ normal)
        q = self.projector.project(in_projector)
        size = np.array([self.grid.width, self.grid.height])
        lit = ((q >= -0.5) & (q <= size - 0.5)).all(-1)
        density = self.projector.density_xyz(*np.moveaxis(in_projector, -1, 0))
        intensity = self.light.projector_power * self.grid.brightness(q) * density / self._sum()
        brdf = _burley(cos_in, cos_out, -(towards * ray).sum(-1), self.tissue.roughness)
        return np.where(lit, intensity * cos_in / distance**2 * brdf, 0.0)

    def _sum(self) -> float:
        """Return the sum of the pattern's luminance over its pixels."""
        axes = [(np.arange(4 * n) + 0.5) / 4 - 0.5 for n in (self.grid.width, self.grid.height)]
        q = np.stack(np.meshgrid(*axes), -1)
        luminance = float(LUMINANCE @ np.array(COLOURS[self.grid.colour]))
        return luminance * float(self.grid.brightness(q).sum()) / 16


def _burley(
    cos_in: NDArray[np.float64],
    cos_out: NDArray[np.float64],
    cos_between: NDArray[np.float64],
    roughness: float,
) -> NDArray[np.float64]:
    """Return the reflectance per steradian for a base colour of 1."""
    cos2_half = (1 + cos_between) / 2
    grazing = 0.5 + 2 * roughness * cos2_half
    return ((1 + (grazing - 1) * (1 - cos_in) ** 5) * (1 + (grazing - 1) * (1 - cos_out) ** 5)
            / np.pi)  # fmt: skip


def plane_under_grid(width: int = 96, height: int = 70) -> PlaneUnderGrid:
    """Return a tilted plane under a green grid of 24 pattern pixels, whose lines are resolved."""
    K = np.array([[1.1 * width, 0, 0.49 * width], [0, 1.05 * width, 0.52 * height], [0, 0, 1]])
    return PlaneUnderGrid(
        camera=CameraModel("opencv", width, height, K, (-0.1, 0.02)),
        pose=RigidTransform.of([0.03, -0.08, 0.05], [-6.0, 1.3, 1.1]),
        projector=projector_model("direction_cosine", 300.0, (239.5, 191.5)),
        grid=CodedGrid(columns=18, rows=14, period=24, line=0.08, oversample=4, seed=2),
        tissue=Tissue(
            base_color=(0.7, 0.4, 0.3), roughness=0.6, specular=0, clearcoat=0, relief=0,
            vessel_contrast=0, subsurface="none",
        ),
        light=Light(projector_power=2000.0),
    )  # fmt: skip
