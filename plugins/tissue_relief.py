"""The texture ``tissue_relief``: the height of fine relief, for ``bumpmap``."""

from typing import Any

from mitsuba_endo.capture.relief import relief
from mitsuba_endo.rendering.mitsuba_modules import dr, mi

from .variants import make_opaque, variant_class
from .vessels import field_frame, to_field


class TissueRelief:
    r"""Fine relief of wet tissue (:monosp:`tissue_relief`), to be nested in ``bumpmap``.

    .. pluginparameters::

     * - slope
       - |float|
       - Root mean square of the relief's slope along the surface. (Default: 0.15)
       - |exposed|, |differentiable|

     * - seed
       - |int|
       - Chooses the relief. (Default: 0)
       -

    A solid texture: the height, in scene units (mm), depends on the position alone, and its
    gradient is exact. Wavelengths are 1.6 and 0.6 mm.

    .. tabs::
        .. code-tab:: xml

            <bsdf type="bumpmap">
                <texture type="tissue_relief">
                    <float name="slope" value="0.2"/>
                </texture>
                <bsdf type="principled"/>
            </bsdf>

        .. code-tab:: python

            'type': 'bumpmap',
            'relief': {'type': 'tissue_relief', 'slope': 0.2},
            'bsdf': {'type': 'principled'},
    """

    def __init__(self, props: Any) -> None:
        mi.Texture.__init__(self, props)
        self.slope = mi.Float(props.get("slope", 0.15))
        self.field = field_frame(int(props.get("seed", 0)))
        self.parameters_changed()

    def traverse(self, callback: Any) -> None:
        callback.put("slope", self.slope, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: Any = ()) -> None:
        make_opaque(self.slope, *self.field)

    def eval_1(self, si: Any, active: Any = True) -> Any:
        return self.slope * relief(to_field(self.field, si.p))[0]

    def eval(self, si: Any, active: Any = True) -> Any:
        return mi.UnpolarizedSpectrum(self.eval_1(si, active))

    def eval_1_grad(self, si: Any, active: Any = True) -> Any:
        """Return the height's derivatives along u and v by the chain rule."""
        slope = mi.Vector3f(*relief(to_field(self.field, si.p))[1])
        world = self.slope * (self.field[0].T @ slope)
        return mi.Vector2f(dr.dot(world, si.dp_du), dr.dot(world, si.dp_dv))

    def mean(self) -> Any:
        return mi.Float(0.0)

    def is_spatially_varying(self) -> bool:
        return True

    def to_string(self) -> str:
        return f"TissueRelief[\n  slope = {self.slope}\n]"


def register(mi: Any) -> None:
    """Register the texture for the active variant."""
    cls = variant_class(TissueRelief, "Texture")
    mi.register_texture("tissue_relief", lambda props: cls(props))
