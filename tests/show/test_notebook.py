"""How a solution shows itself in a notebook."""

from mitsuba_endo.records.solution import Estimate, Frame, PoseEstimate, ProjectorEstimate, Solution


def test_solution_shows_values_units_and_reasons_and_escapes_names() -> None:
    """Oracle: what was put in, by hand; a frame's name is text, not markup."""
    none = Estimate(value=None, std=None, status="unobservable", reason="a plane does not show it")
    pose = PoseEstimate(R=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], t=[-6.25, 0.5, 1], std=[0.001] * 6)
    solution = Solution(
        outcome="converged", units="baseline", scale="up_to_scale", verdict=["Focal: not found."],
        projector=ProjectorEstimate(
            law="pinhole", focal=none, centre=Estimate(value=[239.5, 191.5], status="fixed")
        ),
        frames=[Frame(name="<b>one</b>", projector_from_camera=pose, world_from_camera=pose)],
    )  # fmt: skip
    page = solution._repr_html_()
    assert "Focal: not found." in page
    assert "a plane does not show it" in page
    assert "6.250" in page or "6.25" in page
    assert "<b>one</b>" not in page
    assert "&lt;b&gt;one&lt;/b&gt;" in page
    assert "mm" not in page.split("</style>")[1]
