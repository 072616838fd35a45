"""The live viewer: the scene it puts on its server, and what a browser makes of it."""

import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.rig import Camera, Rig
from mitsuba_endo.show.read_folder import read_solution_folder
from mitsuba_endo.show.result_scene import ResultScene
from mitsuba_endo.show.solution_folder import write_solution_folder
from mitsuba_endo.show.viewer import LiveView, Viewer, address, open_viewer, running_server
from mitsuba_endo.show.viewer.nodes import said
from scripts.benchmarks.chromium import EXECUTABLE, browser
from tests.show.test_truth import write_truth

pytest.importorskip("viser")
Maker = Callable[..., Calibration]
# viser and the socket library under it; nothing of ours.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
PORT = 18080


@pytest.fixture(scope="module")
def calibration(make_calibration: Maker) -> Calibration:
    return make_calibration(width=64, height=46, count=3)


@pytest.fixture
def server() -> Iterator[Any]:
    with running_server("localhost", PORT) as running:
        yield running


@pytest.fixture
def viewer(server: Any, calibration: Calibration) -> Viewer:
    return open_viewer(server, calibration)


def _frames(viewer: Viewer) -> set[int]:
    return {int(n.split("/")[1][6:]) for n in viewer.viser_scene.nodes.visible if "/frame_" in n}


def test_scene_follows_the_controls(viewer: Viewer, server: Any):
    """Oracle: the names of the nodes that each control is for, on viser's own scene."""
    change, nodes = viewer.controls.change, viewer.viser_scene.nodes
    names = [f"/frame_{k}/{kind}{n}" for k in range(3) for kind in ("camera", "projector")
             for n in ("", "_name")]  # fmt: skip
    assert nodes.visible == sorted([*names, "/surface/0"])
    for name in nodes.visible:
        assert server.scene.get_handle_by_name(name).visible
    change(frame=1, rays=True)
    assert _frames(viewer) == {1}
    assert {"/rays_1/camera", "/rays_1/projector"} <= set(nodes.visible)
    assert not server.scene.get_handle_by_name("/frame_0/camera").visible
    change(surface=False, frusta=False, rays=False)
    assert nodes.visible == []
    assert not server.scene.get_handle_by_name("/surface/0").visible
    change(frame=None, surface=True, frusta=True, snapshot=0)
    assert nodes.visible == sorted(
        [*(f"/iteration{name}" for name in names), "/iteration/surface_0"]
    )


def test_iterations_move_what_is_shown(viewer: Viewer, server: Any, calibration: Calibration):
    """Oracle: the history's vertices, and its projector's centre -R^T t in the first camera."""
    for i in (0, 1):
        viewer.controls.change(snapshot=i)
        snapshot = calibration.history[i]
        mesh = server.scene.get_handle_by_name("/iteration/surface_0")
        np.testing.assert_allclose(mesh.vertices, snapshot.surfaces[0], rtol=1e-6)
        pose = snapshot.projector_from_camera[0]
        lines = server.scene.get_handle_by_name("/iteration/frame_0/projector").points
        np.testing.assert_allclose(lines[0, 0], -pose.R.T @ pose.t, rtol=1e-5)
    viewer.controls.change(snapshot=None)
    assert "/surface/0" in viewer.viser_scene.nodes.visible


def test_frames_are_read_when_their_rays_are_wanted(
    server: Any, calibration: Calibration, tmp_path: Path
):
    """Oracle: the rays of the calibration in memory; a damaged map of another frame is told in the
    panel with its name, and everything else stays."""
    write_solution_folder(tmp_path / "out", calibration)
    damaged = next((tmp_path / "out").glob("observed_01*.exr"))
    damaged.write_bytes(damaged.read_bytes()[:500])
    viewer = open_viewer(server, read_solution_folder(tmp_path / "out"))
    viewer.controls.change(frame=0, rays=True)
    found, kept = ResultScene(calibration).rays(0), viewer.scene.rays(0)
    assert found is not None
    assert kept is not None
    np.testing.assert_allclose(kept.camera, found.camera, rtol=1e-4)
    assert "/rays_0/camera" in viewer.viser_scene.nodes.visible
    viewer.controls.change(frame=1, rays=True)
    assert damaged.name in viewer.controls._fault.content
    assert viewer.controls.boxes["rays"].disabled
    assert {"/surface/0", "/frame_1/camera"} <= set(viewer.viser_scene.nodes.visible)
    assert not any("rays" in name for name in viewer.viser_scene.nodes.visible)


def test_own_surfaces_are_shown_with_their_frame(
    server: Any, calibration: Calibration, with_own_surfaces: Callable[[Calibration], Calibration]
):
    """Oracle: one surface a frame, placed where that frame's camera is."""
    viewer = open_viewer(server, with_own_surfaces(calibration))
    assert "/surface/0" in viewer.viser_scene.nodes.visible
    viewer.controls.change(frame=2)
    assert [n for n in viewer.viser_scene.nodes.visible if "surface" in n] == ["/surface/2"]
    pose = calibration.solution.frames[2].world_from_camera
    handle = server.scene.get_handle_by_name("/surface/2")
    np.testing.assert_allclose(handle.position, pose.t, atol=1e-6)


def _click(viewer: Viewer, x: float, y: float) -> None:
    origin, direction = np.array([9.0, -4.0, -20.0]), np.array([x, y, 1.0])
    viewer.controls.clicked(SimpleNamespace(ray_origin=origin, ray_direction=direction))


def test_clicks_measure_a_distance(viewer: Viewer, server: Any):
    """Oracle: the distance between the two marks; the third click starts anew, a click beside
    the surface is told, and not counted."""
    picker = viewer.controls.picker
    _click(viewer, 0.1, 0.05)
    assert picker.words == "One point; click the other."
    _click(viewer, 50.0, 0.0)
    assert "no surface" in picker.words
    _click(viewer, -0.15, 0.1)
    marks = [
        np.array(server.scene.get_handle_by_name(f"/measure/point_{i}").position) for i in (1, 2)
    ]
    expected = np.linalg.norm(marks[0] - marks[1])
    assert float(picker.words.strip("*").split()[0]) == pytest.approx(expected, abs=0.01)
    assert "mm (at least 95 %)" in picker.words
    _click(viewer, 0.0, 0.0)
    assert len(picker.points) == 1
    picker.clear()
    assert server.scene.get_handle_by_name("/measure/line") is None


def test_truth_is_offered_when_it_is_loaded(server: Any, calibration: Calibration, tmp_path: Path):
    """Oracle: a truth that is the result itself: no error anywhere, frusta at the same place."""
    truth = write_truth(tmp_path / "capture", calibration)
    viewer = open_viewer(server, calibration, truth)
    assert viewer.comparison is not None
    viewer.comparison.join(60)
    assert viewer.faults == []
    viewer.controls.change(truth=True, colour="error to truth")
    for part in ("surface", "frame_0/camera", "frame_2/projector"):
        assert f"/truth/{part}" in viewer.viser_scene.nodes.visible
    mine, true = (
        server.scene.get_handle_by_name(f"{p}frame_2/projector").points for p in ("/", "/truth/")
    )
    np.testing.assert_allclose(mine, true)
    assert "found - true" in viewer.controls._legend.content
    other = replace(calibration, frames=calibration.frames[:2])
    frames = calibration.solution.frames[:2]
    other = replace(other, solution=calibration.solution.model_copy(update={"frames": frames}))
    wrong = open_viewer(server, other, write_truth(tmp_path / "wrong", calibration).parent / "x")
    assert wrong.comparison is not None
    wrong.comparison.join(60)
    assert wrong.faults is not None
    assert "no such file" in str(wrong.faults[0])


def test_live_view_shows_every_iteration(server: Any, calibration: Calibration):
    """Oracle: the snapshots: surface, projector, and costs in the chart."""
    camera = Camera.from_model(calibration.camera).model_dump()
    rig = Rig.model_validate({"camera": camera, "projector": {"width": 1024, "height": 768}})
    live = LiveView(server, rig)
    for snapshot in calibration.history:
        live.show(snapshot)
    mesh = server.scene.get_handle_by_name("/iteration/surface_0")
    np.testing.assert_allclose(mesh.vertices, calibration.history[-1].surfaces[0], rtol=1e-6)
    assert {"/iteration/frame_2/camera", "/iteration/frame_0/projector"} <= set(live.nodes.visible)
    np.testing.assert_array_equal(live._chart.data[0], [1, 2])
    np.testing.assert_array_equal(live._chart.data[1], [1.0, 0.5])
    np.testing.assert_array_equal(live._chart.data[2], [2.0, 1.0])
    live.end("converged")
    assert live._state.content == said("converged", bold=True)
    live.show(calibration.history[0])
    assert len(live.history) == 1


def test_taken_port_gives_the_next(server: Any):
    """Oracle: the operating system: the first server's port is in use."""
    with running_server("localhost", server.get_port()) as other:
        assert other.get_port() != server.get_port()
        assert address(other) == f"http://localhost:{other.get_port()}"


def test_address_in_version_6():
    """Oracle: RFC 3986: brackets around it."""
    fake = SimpleNamespace(get_host=lambda: "fe80::1", get_port=lambda: 8080)
    assert address(fake) == "http://[fe80::1]:8080"


@pytest.mark.parametrize(
    ("host", "port", "said"),
    [
        ("192.0.2.1", PORT, "cannot assign requested address"),
        ("nowhere.invalid", PORT, "no such host"),
        ("localhost", 65535, "address already in use"),
    ],
)
def test_address_that_cannot_be_had(host: str, port: int, said: str):
    """Oracle: 192.0.2.1 is kept for documentation (RFC 5737), so is .invalid, and the last port is
    taken here. In a thread, because it once waited for ever."""
    found: list[str] = []

    def start() -> None:
        try:
            with running_server(host, port):
                found.append("listens")
        except InputError as error:
            found.append(str(error))

    with socket.socket() as taken:
        taken.bind(("localhost", 65535))
        taken.listen()
        thread = threading.Thread(target=start, daemon=True)
        thread.start()
        thread.join(20)
    todo = "give another --host or --port."
    assert found == [f"{host}:{port}: cannot listen ({said}); {todo}"]


def test_server_ends(calibration: Calibration):
    """Oracle: the port refuses connections afterwards."""
    with running_server("localhost", PORT + 50) as running:
        port = running.get_port()
        open_viewer(running, calibration)
        socket.create_connection(("localhost", port), timeout=5).close()
    with pytest.raises(OSError):
        socket.create_connection(("localhost", port), timeout=1)


def test_missing_viser_is_told(monkeypatch: pytest.MonkeyPatch):
    """Oracle: the sentence, with what to install."""
    monkeypatch.setitem(sys.modules, "viser", None)
    with (
        pytest.raises(InputError, match=r'viser is not installed.*mitsuba-endo\[view\]"'),
        running_server("localhost", PORT),
    ):
        pass


@pytest.mark.skipif(EXECUTABLE is None, reason="no chromium installed")
def test_works_in_a_browser(viewer: Viewer, server: Any, tmp_path: Path):
    """Oracle: chromium: connected, the surface's colours on the canvas, nothing asked of another
    machine, no exception; a click on the surface is picked."""
    with browser(1000, 700) as page:
        page.open(address(server))
        page.wait_for("document.body.innerText.includes('converged')", 60)
        assert _until(page, tmp_path, lambda share: share > 0.05)
        text = page.evaluate("document.body.innerText")
        for words in ("standard deviation along the camera's rays, mm", "frusta"):
            assert words in text
        viewer.controls.change(surface=False)
        assert _until(page, tmp_path, lambda share: share < 0.03)  # frusta are orange too
        viewer.controls.change(surface=True, frusta=False)
        assert _until(page, tmp_path, lambda share: share > 0.05)
        viewer.controls.pick(True)
        time.sleep(0.5)
        page.click(330, 350)
        deadline = time.monotonic() + 20
        while not viewer.controls.picker.points and time.monotonic() < deadline:
            page.evaluate("1")
            time.sleep(0.1)
        assert len(viewer.controls.picker.points) == 1
        viewer.controls.pick(False)
        local = (address(server), address(server).replace("http", "ws"))
        assert all(request.startswith(local) for request in page.requests), page.requests
        # The first is of three.js itself, the other of drawing without a graphics card.
        known = ("THREE.Clock", "GL Driver Message")
        assert [f for f in page.faults if not any(k in f for k in known)] == []


def _until(page: Any, folder: Path, enough: Callable[[float], bool]) -> bool:
    """Tell whether the share of the scene's pixels in the scale's colours becomes as wanted."""
    import cv2

    deadline = time.monotonic() + 40
    while time.monotonic() < deadline:
        page.screenshot(folder / "page.png")
        image = cv2.imread(str(folder / "page.png"))
        assert image is not None
        left = image[150:, :600].astype(int)
        # Yellow to brown; background and text are grey, and lines are thin.
        coloured = (left[..., 2] - left[..., 0] > 60) & (left[..., 2] >= left[..., 1])
        if enough(float(coloured.mean())):
            return True
        time.sleep(0.2)
    return False
