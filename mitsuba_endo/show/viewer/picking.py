"""Measuring between two points that the user clicks on."""

from typing import Any

import numpy as np

from ..measure import SurfacePoint, distance, pick
from ..result_scene import ResultScene

MARK = (204, 0, 102)
"""Magenta (R, G, B). Chosen for looks."""
HINT = "Tick, then click two points on the surface."


class Picker:
    """Points picked so far, their marks in the scene, and the measured distance."""

    def __init__(self, server: Any, scene: ResultScene) -> None:
        self.server, self.scene = server, scene
        self.points: list[tuple[int, SurfacePoint]] = []
        """Surface and point."""
        self.words = HINT
        self._marks: list[Any] = []

    def add(self, origin: Any, direction: Any, surfaces: list[int]) -> None:
        """Pick the point of the surfaces shown that a ray of the first camera's frame meets."""
        picked = self._nearest(np.asarray(origin, float), np.asarray(direction, float), surfaces)
        if picked is None:
            self.words = "There is no surface; click on it."
            return
        if len(self.points) == 2:
            self.clear()
        if self.points and self.points[0][0] != picked[0]:
            self.words = "The two points must lie on the surface of one frame."
            return
        self.points.append(picked)
        self._mark(picked)
        self.words = "One point; click the other." if len(self.points) == 1 else self._measure()

    def clear(self) -> None:
        """Forget the points."""
        self.points.clear()
        for mark in self._marks:
            mark.remove()
        self._marks.clear()
        self.words = HINT

    def _nearest(
        self, origin: np.ndarray, direction: np.ndarray, surfaces: list[int]
    ) -> tuple[int, SurfacePoint] | None:
        hits = []
        for k in surfaces:
            surface_from_first = self.scene.first_from_surface(k).inverse()
            start, along = surface_from_first.apply(origin), surface_from_first.rotate(direction)
            point = pick(self.scene.surfaces[k], start, along)
            if point is not None:
                hits.append((float(np.linalg.norm(point.position - start)), k, point))
        return min(hits, key=lambda hit: hit[0])[1:] if hits else None

    def _place(self, picked: tuple[int, SurfacePoint]) -> np.ndarray:
        return self.scene.first_from_surface(picked[0]).apply(picked[1].position)

    def _mark(self, picked: tuple[int, SurfacePoint]) -> None:
        name = f"/measure/point_{len(self.points)}"
        self._marks.append(
            self.server.scene.add_icosphere(
                name, 0.009 * self.scene.distance, MARK, position=self._place(picked)
            )
        )

    def _above(self, ends: np.ndarray) -> np.ndarray:
        """Return a place beside the upper end; y points down."""
        return ends[ends[:, 1].argmin()] - [0.0, 0.03 * self.scene.distance, 0.0]

    def _measure(self) -> str:
        (surface, a), (_, b) = self.points
        solution = self.scene.calibration.solution
        measurement = distance(self.scene.surfaces[surface], a, b, solution.scale_std_percent)
        ends = np.stack([self._place(p) for p in self.points])
        scene = self.server.scene
        self._marks.append(
            scene.add_line_segments(
                "/measure/line", ends[None], MARK, thickness=3.0, thickness_units="screen"
            )
        )
        words = measurement.words(solution)
        self._marks.append(
            scene.add_label(
                "/measure/label", words, position=self._above(ends), anchor="bottom-center",
                font_screen_scale=1.2,
            )
        )  # fmt: skip
        return words
