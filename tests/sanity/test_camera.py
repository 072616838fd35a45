"""A camera that cannot be that of the maps draws a finding with the right name."""

import warnings

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.sanity.examine import examine
from tests import rigs
from tests.sanity.given import map_of, record, scaled_K, with_camera

RIG = rigs.random_rig(1)
"""320 x 224 pixels."""
MAP = map_of(RIG.q)
GIVEN = record(RIG)


def _kinds(rig: Rig) -> list[str]:
    return [f.kind for f in examine([MAP], rig).findings]


@pytest.mark.parametrize("factor", [0.5, 2 / 3, 4 / 3, 1.5, 2.0])
def test_other_resolution(factor: float):
    """Oracle: K of an image so many times as large; the image that it fits is named."""
    undistorted = with_camera(GIVEN, K=scaled_K(GIVEN, factor), distortion=[])
    (finding,) = examine([MAP], undistorted).findings
    assert finding.kind == "camera_resolution"
    # Twice the distance of the principal point from the image's edge, half a pixel before 0.
    width, height = (2 * factor * (c + 0.5) for c in (0.47 * 320, 0.54 * 224))
    assert f"about {width:.0f} x {height:.0f} px" in finding.what


@pytest.mark.parametrize(
    ("cx", "kind"),
    [(20.0, "principal_point"), (340.0, "principal_point"), (-5.0, "principal_point"),
     (60.0, "camera_crop"), (250.0, "camera_crop"), (110.0, None), (210.0, None)],
)  # fmt: skip
def test_principal_point_off_the_middle(cx: float, kind: str | None):
    """Oracle: the border's tenth, the outer quarter, and what a decentred lens may have."""
    K = np.array(GIVEN.camera.K)
    K[0, 2] = cx
    assert _kinds(with_camera(GIVEN, K=K.tolist(), distortion=[])) == ([kind] if kind else [])


def test_focal_length_in_millimetres_is_refused():
    """Oracle: 4.6 px would see 178 degrees."""
    K = [[4.6, 0, 150], [0, 4.6, 120], [0, 0, 1]]
    for distortion in ([], [-0.1, 0.02]):
        with pytest.raises(InputError, match=r"camera\.K: .*4\.6 px.*looks like millimetres"):
            examine([MAP], with_camera(GIVEN, K=K, distortion=distortion))


def test_longer_focal_length_in_millimetres():
    """Oracle: 25 px of 320 see 162 degrees: a wide lens, or 25 mm."""
    K = [[25, 0, 150], [0, 25, 120], [0, 0, 1]]
    assert _kinds(with_camera(GIVEN, K=K, distortion=[])) == ["focal_millimetres"]


def test_normalised_matrix_is_refused():
    """Oracle: K over the image's size."""
    K = [[0.94, 0, 0.47], [0, 1.37, 0.54], [0, 0, 1]]
    with pytest.raises(InputError, match="normalised"):
        examine([MAP], with_camera(GIVEN, K=K))


def test_field_of_view():
    """Oracle: a focal length of 3200 px sees 5.7 degrees of 320 px; a fisheye may see 200."""
    K = [[3200, 0, 150], [0, 3200, 120], [0, 0, 1]]
    assert _kinds(with_camera(GIVEN, K=K, distortion=[])) == ["field_of_view"]
    for fx, expected in ((91.7, []), (70.0, ["field_of_view"])):  # 200 and 262 degrees
        K = [[fx, 0, 150], [0, fx, 120], [0, 0, 1]]
        rig = with_camera(GIVEN, model="opencv_fisheye", K=K, distortion=[])
        assert _kinds(rig) == expected


def test_folding_lens_is_masked():
    """Oracle: with k1 = -1/3 alone r (1 - r^2 / 3) has its largest value, 2/3, at r = 1.

    Pixels farther than 2/3 f from the centre have no ray: they and no others are left out.
    """
    f = 200.0
    K = [[f, 0, 159.5], [0, f, 111.5], [0, 0, 1]]
    rig = with_camera(GIVEN, K=K, distortion=[-1 / 3])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        examined = examine([MAP], rig)
    (finding,) = examined.findings
    assert finding.kind == "lens_fold"
    y, x = np.mgrid[:224, :320]
    radius = np.hypot(x - 159.5, y - 111.5) / f
    kept = examined.maps[0].valid
    np.testing.assert_array_equal(
        kept[np.abs(radius - 2 / 3) > 1e-4],
        (MAP.valid & (radius < 2 / 3))[np.abs(radius - 2 / 3) > 1e-4],
    )
    lost = int(MAP.valid.sum() - kept.sum())
    assert lost > 100
    assert f"{lost} of {MAP.valid.sum()} correspondences" in finding.what


def test_lens_that_folds_most_of_the_image_is_refused():
    """Oracle: the contract; K of a resolution too small folds a moderate lens, and is told too."""
    rig = with_camera(GIVEN, K=scaled_K(GIVEN, 0.25), distortion=[-0.33])
    with pytest.raises(InputError, match=r"camera\.distortion.*fold.*likely cause: camera\.K"):
        examine([MAP], rig)


def test_the_far_branch_of_a_folded_lens_is_no_ray():
    """Oracle: with k1 = -1, k2 = 0.3 the radius r - r^3 + 0.3 r^5 falls after 0.44 and rises again
    after 1.35: the inversion may end on the rising branch, and must not count there."""
    K = np.array([[100.0, 0, 0], [0, 100, 0], [0, 0, 1]])
    camera = CameraModel("opencv", 100, 1, K, (-1.0, 0.3))
    fold = next(r for r in np.arange(0, 1, 1e-4) if 1 - 3 * r**2 + 1.5 * r**4 <= 0)
    limit = 100 * (fold - fold**3 + 0.3 * fold**5)
    finite = np.isfinite(camera.rays(camera.pixel_grid())[0, :, 0])
    np.testing.assert_array_equal(finite, np.arange(100) < limit)


def test_fisheye_that_folds():
    """Oracle: theta - theta^3 / 3 has its largest value, 2/3, at one radian."""
    K = np.array([[100.0, 0, 0], [0, 100, 0], [0, 0, 1]])
    camera = CameraModel("opencv_fisheye", 100, 1, K, (-1 / 3,))
    finite = np.isfinite(camera.rays(camera.pixel_grid())[0, :, 0])
    np.testing.assert_array_equal(finite, np.arange(100) < 66.6)
