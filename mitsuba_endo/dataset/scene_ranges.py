"""The part of a dataset's configuration that says what surfaces to draw, and from where to look."""

from typing import Any, Literal

from pydantic import PositiveFloat, ValidationError, field_validator, model_validator

from ..shapes import SHAPES, parameter_names
from .ranges import Anything, Count, Degrees, Number, Positive, Section, Share, log, uniform

FILE = "file"
"""Kind of a scene whose surface the user gives."""
LUMEN = "colon"
"""Kind of a scene that is seen from inside and may have polyps."""

DEFAULT_SCENES: list[dict[str, Any]] = [
    {
        "kind": "colon", "weight": 5, "polyps": {},
        "parameters": {
            "length": [110, 170], "radius": [15, 26], "bend": [0, 0.9],
            "bend_towards": [-3.14159, 3.14159], "fold_depth": [3, 8.5], "fold_spacing": [14, 26],
            "fold_width": [2.4, 4.0], "tenia_depth": [0.5, 2], "edge": 1.3,
        },
    },
    {
        "kind": "stomach", "weight": 3,
        "parameters": {
            "distance": [35, 75], "radius": [60, 90], "angle_x": 1.15, "angle_y": 1.15,
            "fold_depth": [3, 7], "fold_spacing": [12, 22], "furrow_width": [3.5, 6],
            "orientation": [-3.14159, 3.14159], "winding": [0.2, 0.7], "edge": 1.3,
        },
    },
    {
        "kind": "bumpy_sheet", "weight": 2,
        "parameters": {
            "distance": [35, 75], "width": 130, "height": 130, "radius": [100, 300],
            "ripple_depth": [0.5, 4], "ripple_x": [4, 9], "ripple_y": [4, 9],
            "dent_depth": [-6, 6], "dent_at_x": [-15, 15], "dent_at_y": [-15, 15],
            "dent_spread": [30, 120], "edge": 1.2,
        },
    },
    {
        "kind": "concave_sphere",
        "parameters": {
            "distance": [30, 65], "radius": [40, 90], "angle_x": 1.2, "angle_y": 1.2, "edge": 1.1,
        },
    },
    {
        "kind": "rabbit",
        "parameters": {"distance": [45, 65], "height": [60, 90], "yaw": [-3.14159, 3.14159]},
    },
]  # fmt: skip
"""The built-in scenes, in mm and radians: sizes of a colon and a stomach, and simpler surfaces."""


class Polyps(Section):
    """Polyps to raise from a colon's wall."""

    count: Count = uniform(0, 3)
    diameter: Positive = log(3.0, 12.0)
    """Of the base circle, mm."""
    flatness: Share = uniform(0.2, 0.5)
    """Height by diameter, 0.1 to 0.5; one half is a hemisphere."""
    ahead: Number = uniform(12.0, 60.0)
    """Distance from the camera along the lumen, mm."""


class ViewRanges(Section):
    """Where the camera stands before the surface."""

    tilt: Degrees = uniform(0.0, 25.0)
    """Angle of the optical axis with the straight view (the lumen's axis, the surface's normal)."""
    turn: Degrees = uniform(-10.0, 10.0)
    """Then, about the camera's own x and y axes: it looks beside the target."""
    roll: Degrees = uniform(-180.0, 180.0)
    """About the optical axis."""
    distance: Positive = uniform(30.0, 80.0)
    """From the surface, mm; for files seen from the front or outside. Shapes have their own."""
    along: Share = uniform(0.05, 0.55)
    """Place in a colon, as a share of its length."""
    off_axis: Share = uniform(0.0, 0.4)
    """Distance from the lumen's axis, as a share of its radius."""


class Scene(Section):
    """One kind of surface."""

    kind: str
    """Name of a shape, or ``file``."""
    weight: PositiveFloat = 1.0
    """How often it is drawn, relative to the others."""
    parameters: dict[str, Anything] = {}
    """Of the shape; those left out have its defaults, and a seed is drawn."""
    polyps: Polyps | None = None
    """In a colon; none means no polyps."""
    file: str | None = None
    """Mesh (ply, stl, obj, off, glb) or Mitsuba scene (.xml); beside the configuration."""
    unit: Literal["mm", "cm", "m", "um"] = "mm"
    """Of the file's lengths."""
    side: Literal["front", "outside", "inside"] = "front"
    """From where the file's surface is seen: the side its faces' normals point to, outside of a
    solid, or inside of a lumen. The last two are found out, however the faces are wound."""
    view: ViewRanges = ViewRanges()

    @field_validator("kind")
    @classmethod
    def _known_kind(cls, value: str) -> str:
        if value != FILE and value not in SHAPES:
            names = ", ".join([*sorted(SHAPES), FILE])
            raise ValueError(f"there is no kind '{value}'; choose one of {names}")
        return value

    @model_validator(mode="after")
    def _fits_kind(self) -> "Scene":
        if (self.kind == FILE) != (self.file is not None):
            raise ValueError("kind 'file' and the key file go together; give both or neither")
        if self.kind == FILE and self.parameters:
            raise ValueError("a file has no parameters; remove them")
        if self.polyps is not None and self.kind != LUMEN:
            raise ValueError(f"a {self.kind} has no polyps; remove them")
        if self.kind != FILE:
            self._check_parameters()
        return self

    def _check_parameters(self) -> None:
        """Build the shape's record, which checks its values, with each range's ends."""
        unknown = sorted(set(self.parameters) - set(parameter_names(self.kind)))
        if unknown:
            names = ", ".join(parameter_names(self.kind))
            raise ValueError(
                f"parameters.{unknown[0]}: a {self.kind} has no such parameter; it has {names}"
            )
        if "polyps" in self.parameters:
            raise ValueError("parameters.polyps: write polyps as a key of the scene")
        for name, range_ in self.parameters.items():
            for value in range_.values:
                try:
                    SHAPES[self.kind](**{name: value})
                except ValidationError as error:
                    first = error.errors()[0]
                    # Without a place it is about several values, which are drawn together.
                    if first["loc"]:
                        raise ValueError(
                            f"parameters.{name}: {first['msg'].lower()}, not {value!r}"
                        ) from None


def default_scenes() -> list[Scene]:
    """Return folded tubes and stomach walls above all, and simpler surfaces besides."""
    return [Scene.model_validate(scene) for scene in DEFAULT_SCENES]
