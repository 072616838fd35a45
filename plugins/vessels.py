"""The texture ``vessels``: branching blood vessels on any mesh."""

from typing import Any

from mitsuba_endo.capture.solid_fields import field_from_tissue
from mitsuba_endo.capture.vessels import ABSORPTION, vessel_density
from mitsuba_endo.rendering.mitsuba_modules import mi

from .variants import make_opaque, variant_class

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue (Rec. 709)."""


class Vessels:
    r"""Blood vessels over a texture (:monosp:`vessels`).

    .. pluginparameters::

     * - base
       - |spectrum| or |texture|
       - Colour between the vessels. (Default: 1)
       - |exposed|, |differentiable|

     * - contrast
       - |float|
       - Green light that the middle of a vessel takes away, 0 to 1; of red it takes a quarter as
         much, of blue 0.85. (Default: 0.5)
       - |exposed|, |differentiable|

     * - scale
       - |float|
       - Mean distance of the larger vessels, scene units (mm). (Default: 6)
       - |exposed|, |differentiable|

     * - seed
       - |int|
       - Chooses the vessels. (Default: 0)
       -

    A solid texture: its value depends on the position alone, so that a mesh needs no texture
    coordinates and has no seams. For RGB and monochromatic variants.

    .. tabs::
        .. code-tab:: xml

            <texture type="vessels" name="base_color">
                <rgb name="base" value="0.72, 0.36, 0.30"/>
                <float name="contrast" value="0.5"/>
            </texture>

        .. code-tab:: python

            'base_color': {'type': 'vessels', 'contrast': 0.5,
                           'base': {'type': 'rgb', 'value': [0.72, 0.36, 0.30]}},
    """

    def __init__(self, props: Any) -> None:
        mi.Texture.__init__(self, props)
        if mi.is_spectral:
            raise RuntimeError('the texture "vessels" needs an RGB or monochromatic variant')
        self.base = props.get_texture("base", 1.0)
        self.contrast = mi.Float(props.get("contrast", 0.5))
        self.scale = mi.Float(props.get("scale", 6.0))
        self.field = field_frame(int(props.get("seed", 0)))
        self.parameters_changed()

    def traverse(self, callback: Any) -> None:
        differentiable = mi.ParamFlags.Differentiable
        callback.put("base", self.base, differentiable)
        callback.put("contrast", self.contrast, differentiable)
        callback.put("scale", self.scale, differentiable)

    def parameters_changed(self, keys: Any = ()) -> None:
        make_opaque(self.contrast, self.scale, *self.field)

    def _passed(self, si: Any) -> tuple[Any, Any, Any]:
        """Return the share of red, green and blue that vessels let through."""
        taken = self.contrast * vessel_density(to_field(self.field, si.p), self.scale)
        r, g, b = (1 - a * taken for a in ABSORPTION)
        return r, g, b

    def eval(self, si: Any, active: Any = True) -> Any:
        passed = self._passed(si)
        if mi.is_monochromatic:
            return self.base.eval(si, active) * self._luminance(passed)
        return self.base.eval(si, active) * mi.Color3f(*passed)

    def eval_3(self, si: Any, active: Any = True) -> Any:
        return self.base.eval_3(si, active) * mi.Color3f(*self._passed(si))

    def eval_1(self, si: Any, active: Any = True) -> Any:
        return self.base.eval_1(si, active) * self._luminance(self._passed(si))

    @staticmethod
    def _luminance(rgb: tuple[Any, Any, Any]) -> Any:
        r, g, b = LUMINANCE
        return r * rgb[0] + g * rgb[1] + b * rgb[2]

    def mean(self) -> Any:
        return self.base.mean()

    def is_spatially_varying(self) -> bool:
        return True

    def to_string(self) -> str:
        return f"Vessels[\n  contrast = {self.contrast},\n  scale = {self.scale}\n]"


def field_frame(seed: int) -> tuple[Any, Any]:
    """Return the rotation and shift that place a seed's tissue in the field."""
    field = field_from_tissue(seed)
    x, y, z = (float(c) for c in field.t)
    return mi.Matrix3f(field.R.tolist()), mi.Vector3f(x, y, z)


def to_field(frame: tuple[Any, Any], point: Any) -> tuple[Any, Any, Any]:
    """Return the components of a world point in the field's frame."""
    p = frame[0] @ mi.Vector3f(point) + frame[1]
    return p[0], p[1], p[2]


def register(mi: Any) -> None:
    """Register the texture for the active variant."""
    cls = variant_class(Vessels, "Texture")
    mi.register_texture("vessels", lambda props: cls(props))
