"""The viewer's panel: what the user can choose, and what is said about the result."""

import threading
from dataclasses import replace
from typing import Any

from ...errors import InputError
from ...records.calibration import Snapshot
from ..result_scene import ResultScene
from ..solution_values import headline
from .choice import Choice
from .cost_chart import add_cost_chart, chart_data
from .nodes import listed, said, small
from .picking import Picker
from .viser_scene import ViserScene

ALL = "all"


class Controls:
    """Connects the panel to the scene. viser calls back from several threads: one at a time."""

    def __init__(self, server: Any, scene: ResultScene, viser_scene: ViserScene) -> None:
        self.server, self.scene, self.viser_scene = server, scene, viser_scene
        self.choice = Choice(frame=0 if len(scene.surfaces) > 1 else None)
        self.picker = Picker(server, scene)
        self.boxes: dict[str, Any] = {}
        """Check boxes by the choice that they are for."""
        self._lock = threading.RLock()
        self._history = scene.calibration.history
        self._say_result()
        self._add_show()
        self._add_iterations()
        self._add_measure()
        self.change()

    def change(self, **changes: Any) -> None:
        """Change what is chosen and draw it."""
        with self._lock:
            self.choice = replace(self.choice, **changes)
            try:
                self.viser_scene.draw(self.choice)
            except InputError as error:
                self._leave_rays_out(error)
            self._legend.content = self._legend_text()
            self._legend.visible = self.choice.snapshot is None and self.choice.surface

    def _leave_rays_out(self, error: InputError) -> None:
        """Say that a frame's maps, read when its rays are first wanted, cannot be read."""
        self._fault.content = small(f"No rays: {error}")
        box = self.boxes["rays"]
        box.value, box.disabled = False, True
        self.choice = replace(self.choice, rays=False)
        self.viser_scene.draw(self.choice)

    def truth_is_known(self) -> None:
        """Offer what can be shown with the truth that the scene now has."""
        with self._lock:
            self._colour.options = tuple(q.name for q in self.scene.quantities())
            self._truth.disabled = False
            self._truth.hint = f"Truth in grey, from {self.scene.truth.path}"  # type: ignore[union-attr]

    def _say_result(self) -> None:
        solution = self.scene.calibration.solution
        outcome, *facts = headline(solution).split("; ")
        gui = self.server.gui
        gui.add_html(said(outcome.replace("_", " "), bold=True))
        gui.add_html(said(*(fact.replace("_", " ") for fact in facts)))
        if solution.verdict or solution.warnings:
            with gui.add_folder("Verdict", expand_by_default=False):
                gui.add_html(
                    listed([*solution.verdict, *(f"Warning: {w}" for w in solution.warnings)])
                )

    def _add_show(self) -> None:
        gui, scene = self.server.gui, self.scene
        with gui.add_folder("Show"):
            if len(scene.poses) > 1:
                self._add_frames()
            quantities = scene.quantities()
            self._colour = gui.add_dropdown(
                "colour", [q.name for q in quantities], initial_value=quantities[0].name
            )
            self._colour.on_update(lambda _: self.change(colour=self._colour.value))
            self._legend = gui.add_html("")
            self._toggle("surface", "surface", True)
            self._toggle("frusta", "frusta", True, "Blue: camera; orange: projector")
            self._toggle(
                "rays", "rays", False,
                "Some correspondences: both rays of each, blue from the camera, orange from the "
                "projector; where they end is where they pass most closely",
            )  # fmt: skip
            self._fault = gui.add_html("")
            self._truth = self._toggle("truth", "truth", False, "No truth lies with this result")
            self._truth.disabled = True

    def _add_frames(self) -> None:
        names = [at.name for at in self.scene.poses]
        least = 1 if len(self.scene.surfaces) > 1 else 0
        slider = self.server.gui.add_slider("frame", least, len(names), 1, least)
        told = self.server.gui.add_html("")

        def choose(_: Any = None) -> None:
            frame = None if slider.value == 0 else slider.value - 1
            told.content = small(ALL if frame is None else names[frame])
            self.change(frame=frame)

        slider.on_update(choose)
        told.content = small(names[0] if least else ALL)

    def _toggle(self, label: str, field: str, value: bool, hint: str | None = None) -> Any:
        box = self.server.gui.add_checkbox(label, value, hint=hint)
        box.on_update(lambda _: self.change(**{field: box.value}))
        self.boxes[field] = box
        return box

    def _add_iterations(self) -> None:
        history = self._history
        if not history:
            return
        with self.server.gui.add_folder("Optimisation"):
            last = len(history)
            slider = self.server.gui.add_slider("step", 0, last, 1, last, hint="Last: the result")
            told = self.server.gui.add_html(small("result"))
            chart = add_cost_chart(self.server, history)

        def choose(_: Any) -> None:
            index = None if slider.value == last else int(slider.value)
            told.content = small("result" if index is None else snapshot_words(history[index]))
            chart.data = chart_data(history, index)
            self.change(snapshot=index)

        slider.on_update(choose)

    def _add_measure(self) -> None:
        gui = self.server.gui
        with gui.add_folder("Measure"):
            box = gui.add_checkbox("pick points", False)
            self._told = gui.add_html(said(self.picker.words))
            clear = gui.add_button("Clear")

        box.on_update(lambda _: self.pick(box.value))
        clear.on_click(lambda _: self._clear())

    def pick(self, wanted: bool) -> None:
        """Take clicks into the scene for points, or no more."""
        scene = self.server.scene
        if wanted:
            scene.on_click()(self.clicked)
        else:
            scene.remove_click_callback("all")

    def clicked(self, event: Any) -> None:
        """Pick a point where a click's ray meets the surface."""
        self.measure_along(event.ray_direction, event.ray_origin)

    def measure_along(self, direction: Any, origin: Any = (0.0, 0.0, 0.0)) -> None:
        """Pick a point where a ray meets the surface; by default one of the first camera."""
        with self._lock:
            if self.choice.snapshot is None and self.choice.surface:
                surfaces = self.viser_scene.shown_surfaces(self.choice)
                self.picker.add(origin, direction, surfaces)
            else:
                self.picker.words = "Show the result's surface first."
            self._told.content = said(self.picker.words)

    def _clear(self) -> None:
        with self._lock:
            self.picker.clear()
            self._told.content = said(self.picker.words)

    def _legend_text(self) -> str:
        quantities = self.scene.quantities()
        named = [q for q in quantities if q.name == self.choice.colour]
        return (named or quantities)[0].legend()


def snapshot_words(snapshot: Snapshot) -> str:
    """Say in one line what an iteration found."""
    focal = sorted(set(snapshot.focal))
    f = f"f = {focal[0]:.2f}" if len(focal) == 1 else f"f = {focal[0]:.1f} to {focal[-1]:.1f}"
    cost = "start"
    if snapshot.cost is not None and snapshot.scale_px is not None:
        cost = f"cost {snapshot.cost:.3g} at scale {snapshot.scale_px:.3g} px"
    return f"iteration {snapshot.iteration}: {cost}, {f} pattern px"
