"""The emitter ``doe_projector``: a pattern projected through a diffractive optical element."""

from typing import Any

from mitsuba_endo.geometry.projection_models import (
    PROJECTION_MODELS,
    ProjectorModel,
    projector_model,
)
from mitsuba_endo.rendering.axes import fraction_from_pixel, pixel_from_fraction, swap_axes
from mitsuba_endo.rendering.keys import DISTORTION
from mitsuba_endo.rendering.mitsuba_modules import dr, mi
from mitsuba_endo.rendering.projector_coordinates import project_direction

from .variants import make_opaque, pointer_to, read_number, read_to_world, variant_class

_MIN_COSINE = 0.01  # directions beyond 89.4 degrees would overflow the distortion's polynomials
_ROUND_TRIP_PX = 1e-2


class DoeProjector:
    r"""Pattern projector with a laser and a DOE (:monosp:`doe_projector`).

    .. pluginparameters::

     * - pattern
       - |texture|
       - Pattern T; only ratios of its values matter. Row 0 of a bitmap is the top of the pattern
         (y = 0 in OpenCV axes). Use ``raw`` bitmaps for linear values and ``wrap_mode`` ``clamp``.
         (Default: uniform)
       - |exposed|, |differentiable|

     * - width, height
       - |int|
       - Size of the pattern in pattern pixels. (Default: resolution of the texture)
       -

     * - law
       - |string|
       - ``pinhole`` or ``direction_cosine``, see :mod:`mitsuba_endo.geometry.projection_models`.
         (Default: ``pinhole``)
       -

     * - focal
       - |float|
       - Focal length f in pattern pixels, above 0.
       - |exposed|, |differentiable|

     * - centre_x, centre_y
       - |float|
       - Pattern coordinates of the optical axis, integer = pixel centre.
         (Default: middle of the pattern, (width - 1) / 2, (height - 1) / 2)
       - |exposed|, |differentiable|

     * - aspect
       - |float|
       - Ratio fy / fx, above 0. (Default: 1)
       - |exposed|, |differentiable|

     * - k1, k2, p1, p2, k3
       - |float|
       - Distortion in OpenCV's order, on the law's normalised coordinates. (Default: 0)
       - |exposed|, |differentiable|

     * - to_world
       - |transform|
       - Pose in Mitsuba's convention (along +z, y up, as ``lookat`` makes it); no scale.
         (Default: identity)
       - |exposed|, |differentiable|

     * - power
       - |float|
       - Radiant power of the whole pattern: a pattern pixel carries power T(q) / sum(T).
         For coloured patterns T counts by its luminance in the sum. (Default: 1)
       - |exposed|, |differentiable|

    A direction Y in the projector's frame carries the radiant intensity (power per pattern pixel)
    times |dq / d omega|, pattern pixels per steradian of the law. Outside the pattern, behind the
    projector and where strong distortion folds the pattern nothing is emitted; evanescent orders
    of ``direction_cosine`` lose their share of the power. Derivatives treat sum(T) as a constant.
    With law ``pinhole`` it equals Mitsuba's ``projector`` of ``scale`` power f^2 / (pi sum(T)).

    .. tabs::
        .. code-tab:: xml

            <emitter type="doe_projector" id="projector">
                <string name="law" value="direction_cosine"/>
                <float name="focal" value="1200"/>
                <texture type="bitmap" name="pattern">
                    <string name="filename" value="grid.png"/>
                    <boolean name="raw" value="true"/>
                    <string name="wrap_mode" value="clamp"/>
                </texture>
            </emitter>

        .. code-tab:: python

            'type': 'doe_projector',
            'law': 'direction_cosine',
            'focal': 1200,
            'pattern': {'type': 'bitmap', 'filename': 'grid.png', 'raw': True,
                        'wrap_mode': 'clamp'},
    """

    def __init__(self, props: Any) -> None:
        mi.Emitter.__init__(self, props)
        self.m_flags = mi.EmitterFlags.DeltaPosition
        self.law = str(props.get("law", "pinhole"))
        if self.law not in PROJECTION_MODELS:
            raise RuntimeError(
                f'unknown "law" {self.law!r}, expected one of {", ".join(PROJECTION_MODELS)}'
            )
        self.pattern = props.get_texture("pattern", 1.0)
        self.width, self.height = self._read_size(props)
        self.focal = read_number(props, "focal", positive=True)
        self.centre_x = read_number(props, "centre_x", (self.width - 1) / 2)
        self.centre_y = read_number(props, "centre_y", (self.height - 1) / 2)
        self.aspect = read_number(props, "aspect", 1.0, positive=True)
        for name in DISTORTION:
            setattr(self, name, read_number(props, name, 0.0))
        self.power = read_number(props, "power", 1.0)
        self.to_world = read_to_world(props)
        self._refresh()

    def _read_size(self, props: Any) -> tuple[int, int]:
        resolution = self.pattern.resolution()
        width = int(props.get("width", int(resolution[0])))
        height = int(props.get("height", int(resolution[1])))
        if width < 2 or height < 2:
            raise RuntimeError(
                '"width" and "height" of the pattern in pixels are needed: its texture has none'
            )
        return width, height

    def _refresh(self) -> None:
        """Recompute what depends on the parameters: T's sum as a constant, opaque values."""
        total = dr.detach(self.pattern.mean()) * (self.width * self.height)
        self._per_total = dr.select(total > 0, dr.rcp(dr.select(total > 0, total, 1)), 0)
        make_opaque(
            self.focal, self.centre_x, self.centre_y, self.aspect, self.power, self.to_world,
            self._per_total, *self.distortion(),
        )  # fmt: skip

    def traverse(self, callback: Any) -> None:
        mi.Emitter.traverse(self, callback)
        differentiable = mi.ParamFlags.Differentiable
        for name in ("focal", "centre_x", "centre_y", "aspect", *DISTORTION, "power"):
            callback.put(name, getattr(self, name), differentiable)
        callback.put("to_world", self.to_world, differentiable | mi.ParamFlags.Discontinuous)
        callback.put("pattern", self.pattern, differentiable)

    def parameters_changed(self, keys: Any = ()) -> None:
        self._refresh()
        mi.Emitter.parameters_changed(self, list(keys))  # the scene learns of a sampling_weight

    def distortion(self) -> list[Any]:
        """Return k1, k2, p1, p2, k3."""
        return [getattr(self, name) for name in DISTORTION]

    def model(self) -> ProjectorModel:
        """Return the projector's intrinsics, whose values are this emitter's (differentiable)."""
        return projector_model(
            self.law, self.focal, (self.centre_x, self.centre_y), self.aspect, self.distortion()
        )

    def project(self, point: Any) -> tuple[Any, Any, Any, Any]:
        """Project world points: pattern coordinates u, v, intensity per (power of a pixel), mask.

        The mask is true in front of the projector and where distortion does not fold the pattern;
        elsewhere the other values are finite and meaningless, so that derivatives stay finite.
        """
        x, y, z = swap_axes(self.to_world.inverse() @ point)
        model = self.model()
        u, v, front = project_direction(model, x, y, z, _MIN_COSINE)
        x, y, z = dr.select(front, x, 0.0), dr.select(front, y, 0.0), dr.select(front, z, 1.0)
        unfolded = model.distortion.unfolded(*PROJECTION_MODELS[self.law].normalise(x, y, z))
        return (
            mi.Float(u),
            mi.Float(v),
            mi.Float(model.density_xyz(x, y, z)),
            mi.Bool(front & unfolded),
        )

    def inside(self, u: Any, v: Any) -> Any:
        """Return the mask of coordinates on the pattern, half a pixel around its pixel centres."""
        return (u >= -0.5) & (u <= self.width - 0.5) & (v >= -0.5) & (v <= self.height - 0.5)

    def _texture_at(self, u: Any, v: Any, wavelengths: Any, active: Any) -> Any:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wavelengths = wavelengths
        si.uv = mi.Point2f(fraction_from_pixel(u, v, self.width, self.height))
        value = self.pattern.eval(si, active)
        if mi.is_spectral:
            value *= mi.Texture.D65(1.0).eval(si, active)
        return value

    def _incident(self, point: Any, wavelengths: Any, active: Any) -> tuple[Any, Any, Any]:
        """Return the radiant intensity towards ``point``, its uv and the mask of lit points."""
        u, v, density, reached = self.project(point)
        active = active & reached & self.inside(u, v)
        value = self._texture_at(u, v, wavelengths, active)
        value *= self.power * self._per_total * density
        uv = mi.Point2f(fraction_from_pixel(u, v, self.width, self.height))
        return dr.select(active, value, 0.0), uv, active

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        intensity, uv, active = self._incident(it.p, it.wavelengths, active)
        origin = self.to_world.translation()
        towards = origin - it.p
        squared = dr.select(active, dr.squared_norm(towards), 1.0)
        distance = dr.sqrt(squared)
        normal = mi.Normal3f(self.to_world @ mi.Vector3f(0, 0, 1))
        ds = mi.DirectionSample3f(
            origin, normal, uv, it.time, 1.0, True, towards / distance, distance, pointer_to(self)
        )
        return ds, mi.depolarizer(intensity / squared) & active

    def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        intensity, _, active = self._incident(it.p, it.wavelengths, active)
        squared = dr.select(active, dr.squared_norm(self.to_world.translation() - it.p), 1.0)
        return mi.depolarizer(intensity / squared) & active

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return mi.Float(0.0)

    def eval(self, si: Any, active: Any = True) -> Any:
        return mi.Spectrum(0.0)

    def sample_ray(
        self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True
    ) -> tuple[Any, Any]:
        uv, pdf = self.pattern.sample_position(sample3, active)
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.time, si.uv = time, uv
        wavelengths, weight = self.sample_wavelengths(si, sample1, active)
        direction, emitted = self._direction(uv)
        active = active & emitted & (pdf > 0)
        origin = self.to_world.translation()
        ray = mi.Ray3f(origin, self.to_world @ direction, time, wavelengths)
        weight *= self.width * self.height / dr.select(active, pdf, 1.0)
        return ray, mi.depolarizer(dr.select(active, weight, 0.0))

    def _direction(self, uv: Any) -> tuple[Any, Any]:
        """Return the unit local direction of texture positions and the mask of emitted ones."""
        u, v = pixel_from_fraction(uv[0], uv[1], self.width, self.height)
        model = self.model()
        x, y, z = model.unproject_uv(u, v)
        valid = dr.isfinite(mi.Float(z))
        x, y, z = dr.select(valid, x, 0.0), dr.select(valid, y, 0.0), dr.select(valid, z, 1.0)
        u2, v2 = model.project_xyz(x, y, z)  # does not return where no direction reaches (u, v)
        valid &= (abs(u2 - u) < _ROUND_TRIP_PX) & (abs(v2 - v) < _ROUND_TRIP_PX)
        local = mi.Vector3f(*(mi.Float(c) for c in swap_axes((x, y, z))))
        return dr.normalize(local), mi.Bool(valid)

    def sample_wavelengths(self, si: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        if mi.is_spectral:
            wavelengths, weight = self.pattern.sample_spectrum(
                si, mi.sample_shifted(sample), active
            )
            si.wavelengths = wavelengths
            weight *= mi.Texture.D65(1.0).eval(si, active)
        else:
            wavelengths, weight = si.wavelengths, self.pattern.eval(si, active)
        return wavelengths, weight * self.power * self._per_total

    def sample_position(self, time: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        ps = dr.zeros(mi.PositionSample3f)
        ps.p = self.to_world.translation()
        ps.n = self.to_world @ mi.Vector3f(0, 0, 1)
        ps.uv = mi.Point2f(0.5)
        ps.time = time
        ps.pdf = 1.0
        ps.delta = True
        return ps, mi.Float(1.0)

    def bbox(self) -> Any:
        return mi.ScalarBoundingBox3f()  # occupies no region

    def to_string(self) -> str:
        return (
            f"DoeProjector[\n  law = {self.law},\n  size = {self.width} x {self.height},\n"
            f"  focal = {self.focal},\n  centre = [{self.centre_x}, {self.centre_y}],\n"
            f"  aspect = {self.aspect},\n  distortion = {self.distortion()},\n"
            f"  power = {self.power},\n  to_world = {self.to_world},\n"
            f"  pattern = {self.pattern}\n]"
        )


def plugin() -> type:
    """Return the emitter's class for the active variant."""
    return variant_class(DoeProjector, "Emitter")


def register(mi: Any) -> None:
    """Register the emitter for the active variant."""
    cls = plugin()
    mi.register_emitter("doe_projector", lambda props: cls(props))
