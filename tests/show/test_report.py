"""``report.html``: one offline file that says everything and works in a browser."""

import base64
import json
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import replace
from html import escape, unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.solution import Estimate, LeftOut, Outcome, PoseEstimate, save_solution
from mitsuba_endo.records.surface import save_surface
from mitsuba_endo.show.read_folder import read_solution_folder
from mitsuba_endo.show.report import model_section, save_report
from mitsuba_endo.show.result_scene import ResultScene
from mitsuba_endo.show.solution_folder import write_solution_folder
from mitsuba_endo.show.truth import load_truth
from mitsuba_endo.show.view import view_surface
from mitsuba_endo.show.web_images import map_pages
from mitsuba_endo.show.web_scene import _quads, scene_canvas

Maker = Callable[..., Calibration]
VERDICT = ["Focal length: 900 ± 0.82 px (95 %).", "Centre: not determined; x < y & more."]
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


class Page(HTMLParser):
    """What the page refers to, and its visible text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.panels: list[tuple[str, str]] = []
        self.tags: list[str] = []
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        self.tags.append(tag)
        self.references += [v or "" for k, v in attrs if k in ("src", "href", "srcset", "data")]
        if named.get("class") == "panels":
            self.panels.append((named["data-frame"] or "", named["data-coordinate"] or ""))

    def handle_data(self, data: str) -> None:
        self.words += data


def _worded(calibration: Calibration) -> Calibration:
    changes = {
        "verdict": VERDICT,
        "warnings": ["the scale drifts"],
        "left_out": [LeftOut(name="dark.exr", reason="nothing decoded")],
        "versions": {"mitsuba": "3.9.1"},
        "configuration": {"options": {"seed": 41}},
    }
    return replace(calibration, solution=calibration.solution.model_copy(update=changes))


@pytest.fixture(scope="module")
def calibration(make_calibration: Maker) -> Calibration:
    return _worded(make_calibration(width=200, height=150, count=3))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory, calibration: Calibration) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    save_report(path, [("left/result <1>", calibration)])
    return path


def test_is_self_contained(report: Path):
    """Oracle: every reference of the parsed page is a data URI, and the style has none."""
    text = report.read_text(encoding="utf-8")
    page = Page(text)
    assert len(page.references) > 18
    assert all(r.startswith("data:") for r in page.references)
    assert not re.search(r"url\(|@import|https?:", text)
    assert report.stat().st_size < 3_000_000


def test_says_everything(report: Path, calibration: Calibration):
    """Oracle: the solution's sentences and numbers; text from files is not markup."""
    page = Page(report.read_text(encoding="utf-8"))
    assert page.words.index(VERDICT[0]) < page.words.index("Observed, rendered, residual")
    for words in (
        *VERDICT, "the scale drifts", "Frame dark.exr is left out: nothing decoded",
        "left/result <1>", "mitsuba 3.9.1", "41", "± 0.82", "run/frame_2.exr",
        "Given, not measured: camera intrinsics, projector centre, projector aspect",
    ):  # fmt: skip
        assert words in page.words, words
    assert page.panels == [(str(f), c) for f in range(3) for c in "xy"]
    assert escape("result <1>") in report.read_text(encoding="utf-8")
    assert calibration.solution.outcome in page.words


def test_maps_show_the_values(calibration: Calibration):
    """Oracle: the colour scale read at the true value, away from borders between its bands."""
    from mitsuba_endo.show.colours import banded
    from mitsuba_endo.show.panels import coordinate_limits

    pages = map_pages(calibration.frames)
    scale, norm, step = banded(*map(float, coordinate_limits(calibration.frames, 1)))
    image = _pixels(pages.images[2][1].rendered)
    q = calibration.frames[2].rendered[..., 1]
    assert image.shape[:2] == q.shape
    inner = np.abs((q / step) % 1 - 0.5) < 0.35
    inner &= cv2.blur(inner.astype(np.float32), (3, 3)) > 0.99
    expected = 255 * np.asarray(scale(norm(q)))[..., :3]
    assert inner.sum() > 1000
    # The images are compressed with loss.
    assert np.median(np.abs(image - expected)[inner]) < 6


def _pixels(uri: str) -> np.ndarray:
    data = np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert image is not None
    return image[..., ::-1].astype(float)


def test_many_frames_stay_small(make_calibration: Maker, tmp_path: Path):
    """Oracle: the limit of 3 MB, with more pixels than fit at full size."""
    one = make_calibration(width=427, height=342)
    many = type(one)(one.solution, one.camera, one.surface, one.frames * 12, one.trace)
    started = time.process_time()
    save_report(tmp_path / "report.html", [("many", many)])
    assert time.process_time() - started < 20
    assert (tmp_path / "report.html").stat().st_size < 3_000_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, make_calibration: Maker) -> Path:
    """A solution folder of two frames."""
    path = tmp_path_factory.mktemp("results") / "out"
    write_solution_folder(path, make_calibration(width=64, height=46, count=2))
    return path


def test_folder_gives_the_same_report(folder: Path, make_calibration: Maker, tmp_path: Path):
    """Oracle: the arrays and the page made before they were written."""
    calibration = make_calibration(width=64, height=46, count=2)
    read = read_solution_folder(folder / "solution.json")
    for mine, theirs in zip(calibration.frames, read.frames, strict=True):
        np.testing.assert_array_equal(mine.observed, theirs.observed)
        np.testing.assert_array_equal(mine.rendered, theirs.rendered)
        np.testing.assert_array_equal(mine.used, theirs.used)
    assert read.trace == calibration.trace
    save_report(tmp_path / "again.html", [("out", read)])
    first, second = (
        Page(path.read_text(encoding="utf-8"))
        for path in (folder / "report.html", tmp_path / "again.html")
    )
    assert first.words == second.words
    assert first.panels == second.panels


def test_missing_map_is_named(folder: Path, tmp_path: Path):
    """Oracle: the name of the file that was taken away."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / "observed_01_run_frame_1.exr").unlink()
    with pytest.raises(InputError, match=r"observed_01_run_frame_1\.exr: no such file"):
        read_solution_folder(copy)


def test_unknown_values_are_said(tmp_path: Path, make_calibration: Maker):
    """Oracle: null focal length and pose appear as not determined, with the reason."""
    base = make_calibration(width=64, height=46)
    reason = "the surface is one plane"
    focal = Estimate(value=None, status="unobservable", reason=reason)
    pose = PoseEstimate(R=None, t=None, status="unobservable", reason="too little is seen")
    solution = base.solution.model_copy(
        update={
            "projector": base.solution.projector.model_copy(update={"focal": focal}),
            "frames": [base.solution.frames[0].model_copy(update={"projector_from_camera": pose})],
        }
    )
    save_report(tmp_path / "r.html", [("x", replace(base, solution=solution))])
    words = Page((tmp_path / "r.html").read_text(encoding="utf-8")).words
    assert words.count("not determined") == 4
    assert reason in words
    assert "too little is seen" in words


def test_correlations_are_drawn_where_known(tmp_path: Path, make_calibration: Maker):
    """Oracle: one picture more; a value that is not known does not stop it."""
    base = make_calibration(width=64, height=46)
    known = {"unknowns": ["focal length", "aspect ratio"], "matrix": [[1.0, None], [None, None]]}
    solution = base.solution.model_copy(update={"observability": {"correlation": known}})
    counts = []
    for name, calibration in (("with", replace(base, solution=solution)), ("without", base)):
        save_report(tmp_path / name, [("x", calibration)])
        text = (tmp_path / name).read_text(encoding="utf-8")
        counts.append(Page(text).tags.count("img"))
        assert ('alt="correlation"' in text) == (name == "with")
    assert counts[0] == counts[1] + 1


def _scene(text: str) -> dict[str, Any]:
    return json.loads(unescape(re.findall(r'data-scene="(.*?)"', text)[0]))


def _canvas(calibration: Calibration, truth: Path | None = None) -> str:
    scene = ResultScene(calibration)
    if truth is not None:
        scene.truth = load_truth(truth, calibration)
    views = [view_surface(s, calibration.camera) for s in scene.surfaces]
    return scene_canvas(scene, views)


def _points(surface: dict[str, Any]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(surface["points"]), "<f4").reshape(-1, 3).astype(float)


def test_frusta_stand_where_the_solution_says(calibration: Calibration):
    """Oracle: camera at the origin; each projector's apex is -R^T t, moved to the first camera."""
    data = _scene(_canvas(calibration))
    frusta = [line for line in data["lines"] if line["kind"] == "frusta"]
    assert [line["frame"] for line in frusta] == [0, 0, 1, 1, 2, 2]
    apexes = [line["segments"][0][0] for line in frusta]
    expected = []
    for frame in calibration.solution.frames:
        pose, world = frame.projector_from_camera, frame.world_from_camera.to_transform()
        assert world is not None
        centre = -np.array(pose.R).T @ np.array(pose.t)
        expected += [world.t, world.R @ centre + world.t]
    np.testing.assert_allclose(apexes, expected, atol=1e-5)
    assert [len(line["segments"]) for line in frusta] == [8] * 6
    points = _points(data["surfaces"][0])
    pixels = calibration.camera.project(points)
    assert len(points) > 5000
    np.testing.assert_allclose(pixels, np.round(pixels), atol=1e-3)


def test_patches_join_neighbouring_pixels(calibration: Calibration):
    """Oracle: the camera's projection of their corners: squares of one size, once each."""
    surface = _scene(_canvas(calibration))["surfaces"][0]
    quads = np.frombuffer(base64.b64decode(surface["quads"]), "<u2").reshape(-1, 4)
    corners = np.round(calibration.camera.project(_points(surface)))[quads]
    step = corners[0, 2, 0] - corners[0, 0, 0]
    around = step * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_array_equal(corners - corners[:, :1], np.broadcast_to(around, corners.shape))
    assert len(np.unique(corners[:, 0], axis=0)) == len(quads)
    assert len(quads) > 5000


def test_patches_bridge_no_gap():
    """Oracle: counted by hand: 4 x 5 squares, less 4 where the range jumps, less 4 at a hole."""
    y, x = np.mgrid[:5, :6] / 100.0
    points = np.stack([x, y, np.ones_like(x)], -1) * np.where(x > 0.025, 80.0, 50.0)[..., None]
    points[1, 1] = np.nan
    quads = _quads(points)
    assert len(quads) == 20 - 4 - 4
    seen = points[np.isfinite(points[..., 2])]
    assert np.ptp(seen[quads][..., 2], axis=1).max() == 0


def test_own_surfaces_stand_where_their_cameras_are(
    calibration: Calibration, with_own_surfaces: Callable[[Calibration], Calibration]
):
    """Oracle: the same sheet seen by three cameras: its points lie on the first one's surface."""
    data = _scene(_canvas(with_own_surfaces(calibration)))
    assert len(data["surfaces"]) == 3
    sheet = calibration.surface
    for surface in data["surfaces"]:
        points = _points(surface)
        assert len(points) > 2000
        inner = np.abs(points[:, :2]).max(1) < 40
        assert distance_to_mesh(points[inner], sheet.vertices, sheet.faces).max() < 1e-3
    assert [len(colours) for colours in data["colours"]] == [3, 3]


def _write_truth(folder: Path, calibration: Calibration, farther: float) -> Path:
    """Write a truth whose surface lies farther along every ray by a share of its range."""
    truth = calibration.solution.model_copy(
        update={"outcome": Outcome.TRUTH, "scale": "truth", "surface": "truth.ply"}
    )
    save_solution(folder / "truth.json", truth)
    surface = calibration.surface
    save_surface(folder / "truth.ply", replace(surface, vertices=(1 + farther) * surface.vertices))
    return folder / "truth.json"


def test_error_to_the_truth_is_shown(calibration: Calibration, tmp_path: Path):
    """Oracle: found ranges are 1 % short of the truth: all colours on the near side of the
    scale, which is symmetric about zero."""
    truth = _write_truth(tmp_path, calibration, 0.01)
    text = _canvas(calibration, truth)
    assert "found - true distance from the camera, mm" in text
    near, far = (to_rgb(matplotlib.colormaps["PuOr_r"](x)) for x in (0.1, 0.9))
    data = _scene(text)
    colours = np.frombuffer(base64.b64decode(data["colours"][1][0]), np.uint8).reshape(-1, 3) / 255
    known = np.ptp(colours, axis=1) > 0.05
    gap = [np.linalg.norm(colours[known] - c, axis=1) for c in (near, far)]
    assert known.mean() > 0.9
    assert (gap[0] < gap[1]).mean() > 0.98
    kinds = {line["kind"] for line in data["lines"]}
    assert kinds == {"frusta", "rays", "truth"}
    save_report(tmp_path / "r.html", [("x", calibration)], truths=[truth])
    words = Page((tmp_path / "r.html").read_text(encoding="utf-8")).words
    assert "error to truth" in words


def test_old_folders_are_read(folder: Path, tmp_path: Path):
    """Oracle: a folder of before there were histories and modes."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / "history.npz").unlink()
    read = read_solution_folder(copy)
    assert read.history == []
    assert read.surface.modes is None
    save_report(tmp_path / "r.html", [("old", read)])
    assert len(read_solution_folder(folder).history) == 3


def test_results_stand_side_by_side(tmp_path: Path, make_calibration: Maker):
    """Oracle: both names head a column that holds each one's focal length."""
    one = make_calibration(width=64, height=46)
    projector = one.solution.projector.model_copy(
        update={"focal": Estimate(value=912.5, std=0.21, status="measured")}
    )
    other = replace(one, solution=one.solution.model_copy(update={"projector": projector}))
    save_report(tmp_path / "r.html", [("first", one), ("second", other)])
    page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert page.tags.count("article") == 2
    assert "firstsecondUnit" in page.words
    assert "focal length900.00 ± 0.82912.50 ± 0.41pattern px" in page.words


_PROBE = """<script>
window.faults = [];
// A headless page with nothing on a screen gets no frames to animate.
window.requestAnimationFrame = (draw) => setTimeout(draw, 0);
window.addEventListener("error", (e) => window.faults.push(e.message));
window.addEventListener("load", () => {
  const move = (name, value) => {
    const input = document.querySelector(`[name=${name}]`);
    input.value = value;
    input.dispatchEvent(new Event("input", { bubbles: true }));
  };
  document.querySelector("[type=radio][value=y]").click();
  move("frame", 2);
  move("blend", 60);
  const shown = [...document.querySelectorAll(".panels")].filter((p) => p.offsetHeight > 0);
  const broken = [...document.images].filter((i) => i.complete && !i.naturalWidth).length;
  const scene = document.querySelector("canvas.scene");
  document.querySelector(".space [name=rays]").click();
  const painted = () => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [scene.width, scene.height];
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(scene, 0, 0);
    const pixels = context.getImageData(0, 0, scene.width, scene.height).data;
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      if (pixels[i + 3] > 0) count += 1;
    }
    return count / scene.width / scene.height;
  };
  setTimeout(() => {
  const before = painted();
  scene.dispatchEvent(new WheelEvent("wheel", { deltaY: 700, cancelable: true }));
  setTimeout(() => {
  const after = painted();
  const found = [
    before > 0.02 && after > 0.005 && after < 0.6 * before,
    shown.map((p) => p.dataset.frame + p.dataset.coordinate).join(),
    getComputedStyle(shown[0].querySelector("img + img")).opacity,
    document.querySelector(".viewer output").textContent, broken, window.faults.join() || "none",
    document.documentElement.scrollWidth <= window.innerWidth,
  ];
  const note = document.createElement("p");
  note.id = "probe";
  note.textContent = found.join("|");
  document.body.append(note);
  }, 400);
  }, 400);
});
</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium installed")
def test_works_in_a_browser(report: Path, tmp_path: Path):
    """Oracle: chromium: third frame and y shown, blended, the scene painted and smaller
    after the wheel, no picture broken, no console error."""
    probed = tmp_path / "probed.html"
    text = report.read_text(encoding="utf-8")
    probed.write_text(text.replace("<head>", f"<head>{_PROBE}", 1), encoding="utf-8")
    done = subprocess.run(
        [
            str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1200,900",
            "--enable-logging=stderr", "--virtual-time-budget=5000", "--dump-dom",
            probed.as_uri(),
        ],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    found = re.search(r'<p id="probe">(.*?)</p>', done.stdout)
    assert found is not None
    assert found[1] == "true|2y|0.6|run/frame_2.exr|0|none|true"
    assert "CONSOLE" not in done.stderr


def test_the_model_s_candidates_are_listed_with_what_is_known_of_them(
    make_calibration: Maker,
) -> None:
    """A candidate of several values has no number."""
    one = {"words": "camera distortion (k1)", "value": -0.01, "std": 0.001, "unit": "",
           "share": 0.9, "group": ["camera distortion"]}  # fmt: skip
    whole = {**one, "words": "projector centre", "value": None, "std": None, "group": []}
    found = {"suspected": True, "structure": 0.3, "expected": 0.06, "intervals_by": 2.0,
             "candidates": [one, whole]}  # fmt: skip
    made = make_calibration()
    solution = made.solution.model_copy(update={"model": found})
    text = str(model_section(replace(made, solution=solution)))
    assert "-0.01 ± 0.001" in text
    assert "<tr><th>projector centre</th><td></td><td>90 %</td><td></td></tr>" in text
    assert "inf" not in text.replace("information", "")


def _with_photographs(calibration: Calibration) -> Calibration:
    """Give every frame a photograph whose red is its number and whose green grows to the right."""
    shown = {}
    for k, frame in enumerate(calibration.frames):
        height, width = frame.observed.shape[:2]
        image = np.zeros((height, width, 3), np.uint8)
        image[..., 0] = 40 + 4 * k
        image[..., 1] = np.linspace(0, 255, width)
        shown[frame.name] = image
    return replace(calibration, photographs=shown)


def test_photographs_stand_beside_their_maps_and_on_the_surface(
    calibration: Calibration, tmp_path: Path
):
    """Oracle: the photograph's own pixels at the points' projections; one picture a frame."""
    made = _with_photographs(calibration)
    save_report(tmp_path / "r.html", [("x", made)])
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    for frame in made.frames:
        assert text.count(f'alt="photograph {frame.name}"') == 1
    data = _scene(text)
    points = _points(data["surfaces"][0])
    at = np.round(made.camera.project(points)).astype(int)
    image = made.photographs[made.frames[0].name]
    painted = np.frombuffer(base64.b64decode(data["colours"][0][0]), np.uint8).reshape(-1, 3)
    np.testing.assert_array_equal(painted, image[at[:, 1], at[:, 0]])
    assert "The photograph is that of run/frame_0.exr" in text


def test_photographs_are_kept_in_the_folder(calibration: Calibration, tmp_path: Path):
    """Oracle: what was given, but for JPEG and the stretch to white."""
    made = _with_photographs(calibration)
    write_solution_folder(tmp_path / "out", made)
    read = read_solution_folder(tmp_path / "out").photographs
    assert list(read) == [frame.name for frame in made.frames]
    for name, image in made.photographs.items():
        assert np.abs(read[name].astype(float) - image).mean() < 4
    assert "photograph run/frame_2.exr" in (tmp_path / "out" / "report.html").read_text()


def test_the_drawn_cost_falls():
    """Oracle: residuals that halve: the cost under the loss of the end falls with each step, also
    where the loss that was minimised changed, and missed correspondences cost the most."""
    from mitsuba_endo.records.calibration import TraceRow
    from mitsuba_endo.solve.costs.noise_scale import NoiseScale
    from mitsuba_endo.solve.minimisers.result import with_fixed_cost

    base = np.abs(np.random.default_rng(0).normal(size=256))
    rows = [
        TraceRow(i, 0.1, cost, 900.0, 1.0, 1.0, 1.0, lengths=tuple((base * 0.5**i).tolist()))
        for i, cost in enumerate((0.9, 1.3, 1.2, 1.4))
    ]
    missed = replace(rows[0], lengths=(float("inf"),) * 256)
    noise = NoiseScale(0.2, "tukey", last=True)
    costs = [row.fixed_cost for row in with_fixed_cost([missed, *rows], noise)]
    assert None not in costs
    assert costs == sorted(costs, reverse=True)  # type: ignore[type-var]
    assert costs[0] == pytest.approx(6.5**2 / 6)


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium installed")
def test_the_ruler_says_what_the_package_says(make_calibration: Maker, tmp_path: Path):
    """Oracle: ``show.measure.distance`` of the same two points, with shared errors and a unit that
    is known to 1 %; in Chromium."""
    from mitsuba_endo.show.measure import distance, pick
    from mitsuba_endo.show.solution_values import interval
    from scripts.benchmarks.chromium import browser

    made = make_calibration()
    std = made.surface.std
    assert std is not None
    modes = np.random.default_rng(0).normal(size=(6, 1)) * 0.3 * std[:, None].T
    surface = replace(made.surface, modes=modes.T)
    solution = made.solution.model_copy(update={"scale_std_percent": 1.0})
    made = replace(made, surface=surface, solution=solution)
    save_report(tmp_path / "r.html", [("x", made)])
    points = _points(_scene((tmp_path / "r.html").read_text(encoding="utf-8"))["surfaces"][0])
    chosen = [len(points) // 3, 2 * len(points) // 3 + 40]
    ends = [pick(surface, np.zeros(3), points[i]) for i in chosen]
    assert ends[0] is not None
    assert ends[1] is not None
    expected = distance(surface, ends[0], ends[1], 1.0)
    script = (
        "(() => { const data = JSON.parse(document.querySelector('.space').dataset.scene);"
        "const s = data.surfaces[0];"
        "return measured(new Float32Array(decoded(s.points)), s.origin, deviations(s), data,"
        f" {chosen[0]}, {chosen[1]}); }})()"
    )
    with browser(1400, 900) as page:
        page.open((tmp_path / "r.html").as_uri())
        told = page.evaluate(script)
        assert page.faults == []
    length, half = (float(x) for x in told.removesuffix(" mm").split(" ± "))
    assert length == pytest.approx(expected.value, rel=2e-3)
    assert expected.std is not None
    assert half == pytest.approx(1.96 * expected.std, rel=0.03)
    assert told.endswith(" mm")
    assert interval(expected.value, expected.std)[0]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium installed")
@pytest.mark.parametrize("count", [1, 4, 20, 50])
def test_the_first_picture_needs_no_scrolling(make_calibration: Maker, tmp_path: Path, count: int):
    """Oracle: Chromium with a window of 1400 x 900: the scene ends above the window's edge, the
    page has no error and is below 8 MB, whatever the number of frames and sentences."""
    from scripts.benchmarks.chromium import browser

    made = _with_photographs(make_calibration(width=160, height=120, count=count))
    # As long as what is said of many frames that see too little.
    reason = "it cannot be separated from other poses, and more depth would help; " * 4
    sentences = [f"Projector pose of frame {k}: {reason}" for k in range(2 * count)]
    unknowns = [
        f"projector pose of frame {k} (translation {a})" for k in range(count) for a in "xyz"
    ]
    correlation = {"unknowns": unknowns, "matrix": np.eye(3 * count).tolist()}
    solution = made.solution.model_copy(
        update={
            "verdict": sentences, "warnings": sentences,
            "observability": {"correlation": correlation},
        }
    )  # fmt: skip
    save_report(tmp_path / "r.html", [("x", replace(made, solution=solution))])
    assert (tmp_path / "r.html").stat().st_size < 8_000_000
    with browser(1400, 900) as page:
        page.open((tmp_path / "r.html").as_uri())
        bottom = page.evaluate(
            "document.querySelector('canvas.scene').getBoundingClientRect().bottom"
        )
        broken = page.evaluate("[...document.images].filter((i) => !i.naturalWidth).length")
        assert bottom <= 900
        assert broken == 0
        assert page.faults == []
        assert page.requests == [(tmp_path / "r.html").as_uri()]


def test_names_are_no_markup(calibration: Calibration, tmp_path: Path):
    """Oracle: a frame and a result called as a script are text in every section and attribute."""
    evil = "<script>alert(1)</script>\"'"
    frames = [f.model_copy(update={"name": evil + str(k)})
              for k, f in enumerate(calibration.solution.frames)]  # fmt: skip
    maps = [replace(m, name=evil + str(k)) for k, m in enumerate(calibration.frames)]
    solution = calibration.solution.model_copy(update={"frames": frames, "verdict": [evil]})
    made = replace(calibration, solution=solution, frames=maps)
    save_report(tmp_path / "r.html", [(evil, made), (evil + "2", made)])
    page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert page.tags.count("script") == 1
    assert page.words.count(evil) > 6
    assert f"data-frames='{evil}" not in (tmp_path / "r.html").read_text(encoding="utf-8")
