"""A finished result in the viewer."""

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...records.calibration import Calibration
from ..result_scene import ResultScene
from .controls import Controls
from .viser_scene import ViserScene


@dataclass(frozen=True, eq=False)
class Viewer:
    """What is shown on a server."""

    scene: ResultScene
    viser_scene: ViserScene
    controls: Controls
    comparison: threading.Thread | None = None
    """Loads the truth; Mitsuba, which it needs, takes longer to start than the viewer."""
    faults: list[InputError] | None = None
    """Why there is no truth."""


def open_viewer(server: Any, calibration: Calibration, truth: Path | None = None) -> Viewer:
    """Show a result on a server of :func:`running_server`; the truth follows when it is loaded."""
    scene = ResultScene(calibration)
    viser_scene = ViserScene(server, scene)
    controls = Controls(server, scene, viser_scene)
    if truth is None:
        return Viewer(scene, viser_scene, controls)
    faults: list[InputError] = []

    def compare() -> None:
        try:
            scene.compare(truth)
        except InputError as error:
            faults.append(error)
            return
        controls.truth_is_known()

    thread = threading.Thread(target=compare, name="truth")
    thread.start()
    return Viewer(scene, viser_scene, controls, thread, faults)
