"""``law: auto``. Oracle: the law with which the maps were made."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.range_scenes import height_field
from tests.solve.views import POSE, Views, look, projector_poses, relief_surface, steps

pytestmark = pytest.mark.usefixtures("llvm")


def with_both_laws(views: Views) -> Calibration:
    rig = views.rig()
    projector = rig.projector.model_copy(update={"law": "auto"})
    return calibrate(
        views.maps, rig.model_copy(update={"projector": projector}), Options(jackknife=False)
    )


@pytest.mark.parametrize("law", ["pinhole", "direction_cosine"])
def test_law_of_the_data_is_chosen(law: str) -> None:
    views = look(relief_surface(), steps(2), projector_poses(2), law=law)
    solution = with_both_laws(views).solution
    other = {"pinhole": "direction_cosine", "direction_cosine": "pinhole"}[law]
    evidence = solution.law_evidence
    assert solution.projector.law == evidence["chosen"] == law
    assert evidence["decided"]
    assert evidence["conclusion"].startswith(f"the residuals support {law} over {other}")
    assert evidence["noise_px"][law] < evidence["noise_px"][other]
    assert evidence["standard_errors"] > 5
    assert not any("cannot tell" in w for w in solution.warnings)


def test_data_that_cannot_tell() -> None:
    """A narrow view of a nearly flat sheet, and much noise: the laws differ by less than it.

    Within 8 degrees of the axis a direction cosine is f (sin - tan) = 0.6 px from a pinhole, and
    most of that another focal length makes up for.
    """
    sheet = height_field(lambda x, y: 70 + 0.1 * x + np.sin(x / 9) + 0.5 * np.cos(y / 7))
    views = look(sheet, [RigidTransform.identity()], [POSE], noise=6.0, outliers=0.0)
    q = views.maps[0].q.astype(np.float64)
    middle = np.full_like(q, np.nan)
    middle[30:54, 40:68] = q[30:54, 40:68]
    solution = with_both_laws(views.with_map(0, middle)).solution
    assert not solution.law_evidence["decided"]
    assert "cannot tell" in solution.law_evidence["conclusion"]
    assert any("give projector.law if it is known" in w for w in solution.warnings)
