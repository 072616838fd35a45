"""Figures show the data they are given, with units, and leave no global state behind."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from matplotlib import _pylab_helpers
from matplotlib.figure import Figure

from mitsuba_endo.records.calibration import Calibration, TraceRow
from mitsuba_endo.records.solution import Estimate
from mitsuba_endo.show import figures
from mitsuba_endo.show.view import SurfaceView, view_surface

SIZE = {"width": 60, "height": 44}
Maker = Callable[..., Calibration]


@pytest.fixture(scope="module")
def calibration(make_calibration: Maker) -> Calibration:
    return make_calibration(**SIZE)


@pytest.fixture(scope="module")
def view(calibration: Calibration) -> SurfaceView:
    return view_surface(calibration.surface, calibration.camera)


def _labels(figure: Figure) -> list[str]:
    return [axes.get_ylabel() for axes in figure.axes] + [axes.get_xlabel() for axes in figure.axes]


def _images(figure: Figure) -> list[np.ndarray]:
    return [np.ma.filled(axes.images[0].get_array(), np.nan) for axes in figure.axes if axes.images]


@pytest.mark.parametrize("which", ["observed", "rendered"])
def test_coordinates(calibration: Calibration, which: Any):
    """Oracle: the maps themselves, x left and y right, and a unit on each scale."""
    figure = figures.coordinates_figure(calibration.frames, which)
    expected = getattr(calibration.frames[0], which)
    for image, channel in zip(_images(figure), (0, 1), strict=True):
        np.testing.assert_array_equal(image, expected[..., channel])
    assert sum("pattern px" in label for label in _labels(figure)) == 2
    titles = [axes.get_title() for axes in figure.axes[:2]]
    assert titles == [f"{which.capitalize()} projector {c}" for c in "xy"]


def test_observed_and_rendered_share_their_scale(calibration: Calibration):
    """Oracle: equal limits, or the two pictures could not be compared by eye."""
    limits = [
        [axes.images[0].get_clim() for axes in figure.axes if axes.images]
        for figure in (
            figures.coordinates_figure(calibration.frames, "observed"),
            figures.coordinates_figure(calibration.frames, "rendered"),
        )
    ]
    assert limits[0] == limits[1]


def test_residual_is_signed_and_symmetric(calibration: Calibration):
    """Oracle: observed - rendered where used; a scale centred on zero with the unit."""
    figure = figures.residual_figure(calibration.frames)
    frame = calibration.frames[0]
    for image, channel in zip(_images(figure), (0, 1), strict=True):
        expected = np.where(frame.used, frame.residual[..., channel], np.nan)
        np.testing.assert_array_equal(image, expected)
    low, high = figure.axes[0].images[0].get_clim()
    assert low == -high
    # Noise of 0.3 px: 98 % of a normal distribution lie within 2.33 standard deviations.
    assert high == pytest.approx(0.7, rel=0.1)
    assert "observed - rendered, pattern px" in _labels(figure)


def test_histogram_is_a_density(calibration: Calibration):
    """Oracle: the area under each curve is one: the limits hold nearly every residual."""
    figure = figures.histogram_figure(calibration.frames, noise_px=0.3, scale_px=1.0)
    axes = figure.axes[0]
    for patch in axes.patches[:2]:
        data = patch.get_data()  # pyright: ignore[reportAttributeAccessIssue]
        assert np.sum(data.values * np.diff(data.edges)) == pytest.approx(1, abs=0.01)
    texts = [t.get_text() for t in axes.get_legend().get_texts()]
    assert texts[2:] == ["normal, 0.3 px", "robust scale, 1 px"]
    assert "pattern px" in axes.get_xlabel()


@pytest.mark.parametrize("focal", [True, False])
def test_convergence(calibration: Calibration, focal: bool):
    """Oracle: the trace's numbers; no focal length panel where it is per frame."""
    trace = calibration.trace
    if not focal:
        trace = [replace(row, focal=None) for row in trace]
    figure = figures.convergence_figure(trace)
    assert len(figure.axes) == (2 if focal else 1)
    line = figure.axes[0].lines[0]
    np.testing.assert_array_equal(line.get_ydata(), [row.cost for row in trace])
    if focal:
        np.testing.assert_array_equal(
            figure.axes[1].lines[0].get_ydata(), [row.focal for row in trace]
        )
    assert "8 iterations, 1.6 s" in figure.axes[0].get_title()


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_every_frame_has_its_pair_of_panels(make_calibration: Maker, count: int):
    """Oracle: two visible images a frame, titled with its name where there are several."""
    frames = make_calibration(**SIZE, count=count).frames
    figure = figures.residual_figure(frames)
    shown = [axes for axes in figure.axes if axes.images]
    assert len(shown) == 2 * count
    if count > 1:
        for i, axes in enumerate(shown):
            assert axes.get_title().endswith(frames[i // 2].name)


def test_surface(calibration: Calibration, view: SurfaceView):
    """Oracle: two panels with std, one without, and the unit given."""
    figure = figures.surface_figure(view, "baselines")
    assert {"depth, baselines", "standard deviation, baselines"} <= set(_labels(figure))
    assert len(_images(figures.surface_figure(replace(view, std=None), "mm"))) == 1


def test_overview_says_the_essential(calibration: Calibration, view: SurfaceView):
    """Oracle: the solution's numbers in the title."""
    figure = figures.overview_figure(calibration, view)
    assert figure.get_suptitle() == (
        "converged; focal length 900.00 ± 0.82 pattern px (95 %); baseline 6.1814 mm (given); "
        "residual 0.31 px RMS"
    )
    assert len(_images(figure)) == 4


def test_headline_never_shows_what_is_unknown(calibration: Calibration):
    """Oracle: words in place of numbers."""
    solution = calibration.solution
    unknown = Estimate(value=None, status="unobservable")
    projector = solution.projector.model_copy(update={"focal": unknown})
    changed = solution.model_copy(update={"projector": projector, "units": "baseline"})
    text = figures.headline(changed)
    assert "focal length unknown (unobservable)" in text
    assert "up to scale" in text
    fixed = Estimate(value=900.0, status="fixed")
    projector = solution.projector.model_copy(update={"focal": fixed})
    given = figures.headline(solution.model_copy(update={"projector": projector}))
    assert "focal length 900 pattern px (given)" in given


def test_projectors_are_placed_in_the_first_camera(make_calibration: Maker):
    """Oracle: the same rig seen from the first camera: camera motion times the fixed rig."""
    solution = make_calibration(**SIZE, count=2).solution
    found = figures.projector_poses(solution)
    pose = solution.frames[0].projector_from_camera.to_transform()
    motion = solution.frames[1].world_from_camera.to_transform()
    assert pose is not None
    assert motion is not None
    np.testing.assert_allclose(found[0].t, pose.inverse().t)
    np.testing.assert_allclose(found[1].t, motion.apply(pose.inverse().t))


def test_nothing_seen_is_still_drawn(calibration: Calibration, view: SurfaceView):
    """Oracle: pictures without any finite value raise no warning (warnings are errors here)."""
    frame = calibration.frames[0]
    nothing = np.full_like(frame.rendered, np.nan)
    empty = replace(frame, observed=nothing, rendered=nothing, used=np.zeros_like(frame.used))
    blank = replace(view, points=np.full_like(view.points, np.nan))
    broken = replace(calibration, frames=[empty], trace=[])
    figures.overview_figure(broken, blank).draw_without_rendering()
    figures.convergence_figure(
        [TraceRow(0, 0.0, 0.0, None, 1.0, 1.0, 0.0)]
    ).draw_without_rendering()


def test_png_is_written_and_no_state_stays(tmp_path: Path, calibration: Calibration):
    """Oracle: OpenCV reads it at the figure's size; pyplot knows of no figure."""
    figure = figures.histogram_figure(calibration.frames)
    figures.save_figure(tmp_path / "h.png", figure)
    image = cv2.imread(str(tmp_path / "h.png"))
    assert image is not None
    assert image.shape[:2] == (int(4.5 * figures.DPI), int(7 * figures.DPI))
    assert 0 < (image != 255).mean() < 0.5
    assert [p.name for p in tmp_path.iterdir()] == ["h.png"]
    assert not _pylab_helpers.Gcf.figs
