"""The sensor ``endoscope``: a camera with the lens models of OpenCV and of wide angles."""

from typing import Any

from mitsuba_endo.geometry.cameras import CAMERAS
from mitsuba_endo.rendering.axes import fraction_from_pixel, pixel_from_fraction, swap_axes
from mitsuba_endo.rendering.mitsuba_modules import dr, mi

from .variants import make_opaque, pointer_to, read_number, read_to_world, variant_class

_INTRINSICS = ("fx", "fy", "cx", "cy")


class Endoscope:
    r"""Endoscope camera (:monosp:`endoscope`).

    .. pluginparameters::

     * - model
       - |string|
       - ``opencv`` (pinhole with Brown distortion), ``opencv_fisheye``, ``omni`` (unified sphere),
         ``double_sphere`` or ``scaramuzza`` (polynomial). (Default: ``opencv``)
       -

     * - fx, fy
       - |float|
       - Focal lengths in pixels, above 0. (fy defaults to fx)
       - |exposed|, |differentiable|

     * - cx, cy
       - |float|
       - Principal point in pixels, integer = pixel centre.
         (Default: middle of the film, (width - 1) / 2, (height - 1) / 2)
       - |exposed|, |differentiable|

     * - k1, k2, p1, p2, k3, k4, k5, k6
       - |float|
       - Brown distortion in OpenCV's order; ``opencv_fisheye`` takes k1, k2, k3, k4 and ``omni``
         k1, k2, p1, p2, k3. (Default: 0)
       - |exposed|, |differentiable|

     * - xi, alpha
       - |float|
       - Shift of the sphere of ``omni`` and ``double_sphere``, and the latter's second shift.
         (Default: 0)
       - |exposed|, |differentiable|

     * - b1, b2, b3, b4, d, e
       - |float|
       - Polynomial of the normalised radius and skew of ``scaramuzza``. (Default: 0)
       - |exposed|, |differentiable|

     * - to_world
       - |transform|
       - Pose in Mitsuba's convention (along +z, y up, as ``lookat`` makes it); no scale.
         (Default: identity)
       - |exposed|, |differentiable|

     * - near_clip, far_clip
       - |float|
       - Range of distances along the ray in which surfaces are seen. Along the ray, and not along
         the axis as in ``perspective``, because a fisheye sees beyond 90 degrees.
         (Default: 0.01, 10000)
       -

     * - (Nested plugin)
       - :paramtype:`film`, :paramtype:`sampler`
       - Film, whose full size is the calibrated image (a crop window may cut it), and sampler.
       -

    Pixels at which the lens model has no ray (folded distortion) see nothing. Light tracing works:
    ``sample_direction`` returns the importance, |d pixel / d omega| over the number of pixels.

    .. tabs::
        .. code-tab:: xml

            <sensor type="endoscope" id="camera">
                <float name="fx" value="420"/>
                <float name="k1" value="-0.25"/>
                <film type="hdrfilm">
                    <integer name="width" value="480"/>
                    <integer name="height" value="360"/>
                </film>
            </sensor>

        .. code-tab:: python

            'type': 'endoscope',
            'fx': 420,
            'k1': -0.25,
            'film': {'type': 'hdrfilm', 'width': 480, 'height': 360},
    """

    film: Any  # of mi.Sensor

    def __init__(self, props: Any) -> None:
        mi.Sensor.__init__(self, props)
        self.model = str(props.get("model", "opencv"))
        if self.model not in CAMERAS:
            expected = ", ".join(CAMERAS)
            raise RuntimeError(f'unknown "model" {self.model!r}, expected one of {expected}')
        width, height = (int(n) for n in self.film().size())
        if width < 1 or height < 1:
            raise RuntimeError(f'"width" and "height" of the film are {width} and {height} pixels')
        self.fx = read_number(props, "fx", positive=True)
        self.fy = read_number(props, "fy", props["fx"], positive=True)
        self.cx = read_number(props, "cx", (width - 1) / 2)
        self.cy = read_number(props, "cy", (height - 1) / 2)
        for name in CAMERAS[self.model].coefficients:
            setattr(self, name, read_number(props, name, 0.0))
        self.near_clip = float(props.get("near_clip", 1e-2))
        self.far_clip = float(props.get("far_clip", 1e4))
        if not 0 < self.near_clip < self.far_clip:
            raise RuntimeError('"near_clip" must be positive and smaller than "far_clip"')
        self.to_world = read_to_world(props)
        self.m_needs_sample_3 = False
        self._refresh()

    def _refresh(self) -> None:
        self.m_to_world = self.to_world  # what world_transform() returns
        make_opaque(self.fx, self.fy, self.cx, self.cy, self.to_world, *self.distortion())

    def traverse(self, callback: Any) -> None:
        mi.Sensor.traverse(self, callback)
        moving = mi.ParamFlags.Differentiable | mi.ParamFlags.Discontinuous
        for name in (*_INTRINSICS, *CAMERAS[self.model].coefficients, "to_world"):
            callback.put(name, getattr(self, name), moving)

    def parameters_changed(self, keys: Any = ()) -> None:
        mi.Sensor.parameters_changed(self, keys)
        self._refresh()

    def distortion(self) -> list[Any]:
        """Return the lens coefficients in the order of the model."""
        return [getattr(self, name) for name in CAMERAS[self.model].coefficients]

    def _local_direction(self, u: Any, v: Any) -> Any:
        """Return the unit direction of pixels in Mitsuba's sensor frame; NaN where none exists."""
        a, b = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        local = swap_axes(CAMERAS[self.model].direction(self.distortion(), a, b))
        return dr.normalize(mi.Vector3f(*(mi.Float(c) for c in local)))

    def _pixel(self, sample: Any) -> tuple[Any, Any]:
        """Return the pixel coordinates of positions [0, 1]^2 of the film's crop window."""
        film = self.film()
        size, offset = film.crop_size(), film.crop_offset()
        u, v = pixel_from_fraction(sample[0], sample[1], int(size[0]), int(size[1]))
        return u + int(offset[0]), v + int(offset[1])

    def _ray(self, cls: Any, time: Any, sample1: Any, u: Any, v: Any) -> tuple[Any, Any]:
        si = dr.zeros(mi.SurfaceInteraction3f)
        wavelengths, weight = mi.Sensor.sample_wavelengths(self, si, sample1)
        direction = self._local_direction(u, v)
        seen = dr.all(dr.isfinite(direction))
        ray = dr.zeros(cls)
        ray.time, ray.wavelengths = time, wavelengths
        ray.d = self.to_world @ dr.select(seen, direction, mi.Vector3f(0, 0, 1))
        ray.o = self.to_world.translation() + self.near_clip * ray.d
        ray.maxt = dr.select(seen, mi.Float(self.far_clip - self.near_clip), mi.Float(0.0))
        return ray, dr.select(seen, weight, 0.0)

    def sample_ray(
        self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True
    ) -> tuple[Any, Any]:
        return self._ray(mi.Ray3f, time, sample1, *self._pixel(sample2))

    def sample_ray_differential(
        self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True
    ) -> tuple[Any, Any]:
        u, v = self._pixel(sample2)
        ray, weight = self._ray(mi.RayDifferential3f, time, sample1, u, v)
        ray.o_x = ray.o_y = ray.o
        ray.d_x = self.to_world @ self._local_direction(u + 1, v)
        ray.d_y = self.to_world @ self._local_direction(u, v + 1)
        ray.has_differentials = True
        return ray, weight

    def _importance(self, point: Any, active: Any) -> tuple[Any, Any, Any]:
        """Return the importance towards world points, their film position and the mask seen."""
        film = self.film()
        size, offset = film.crop_size(), film.crop_offset()
        x, y, z = swap_axes(self.to_world.inverse() @ point)
        length = dr.sqrt(x * x + y * y + z * z)
        active = active & (length >= self.near_clip) & (length <= self.far_clip)
        active &= CAMERAS[self.model].projectable(self.distortion(), x, y, z)
        x, y, z = dr.select(active, x, 0.0), dr.select(active, y, 0.0), dr.select(active, z, 1.0)
        law = CAMERAS[self.model]
        a, b = law.normalise(self.distortion(), x, y, z)
        area, unfolded = law.density(self.distortion(), x, y, z)
        u = mi.Float(self.cx + self.fx * a) - int(offset[0])
        v = mi.Float(self.cy + self.fy * b) - int(offset[1])
        position = mi.Point2f(fraction_from_pixel(u, v, int(size[0]), int(size[1])))
        active &= unfolded & dr.all((position >= 0) & (position <= 1))
        value = mi.Float(self.fx * self.fy * area) / (int(size[0]) * int(size[1]))
        return dr.select(active, value, 0.0), position * mi.ScalarVector2f(size), active

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        importance, position, active = self._importance(it.p, active)
        origin = self.to_world.translation()
        towards = origin - it.p
        squared = dr.select(active, dr.squared_norm(towards), 1.0)
        distance = dr.sqrt(squared)
        normal = mi.Normal3f(self.to_world @ mi.Vector3f(0, 0, 1))
        ds = mi.DirectionSample3f(
            origin,
            normal,
            position,
            it.time,
            1.0,
            True,
            towards / distance,
            distance,
            pointer_to(None),
        )
        return ds, mi.Spectrum(importance / squared)

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return mi.Float(0.0)

    def eval(self, si: Any, active: Any = True) -> Any:
        return mi.Spectrum(0.0)

    def bbox(self) -> Any:
        origin = mi.ScalarPoint3f(*(float(dr.slice(c)) for c in self.to_world.translation()))
        return mi.ScalarBoundingBox3f(origin)

    def to_string(self) -> str:
        return (
            f"Endoscope[\n  model = {self.model},\n  fx = {self.fx}, fy = {self.fy},\n"
            f"  cx = {self.cx}, cy = {self.cy},\n  distortion = {self.distortion()},\n"
            f"  near_clip = {self.near_clip}, far_clip = {self.far_clip},\n"
            f"  film = {self.film()},\n  to_world = {self.to_world}\n]"
        )


def register(mi: Any) -> None:
    """Register the sensor for the active variant."""
    cls = variant_class(Endoscope, "Sensor")
    mi.register_sensor("endoscope", lambda props: cls(props))
