"""The integrator ``projector_coords``: which pattern coordinate lights what each pixel sees."""

from typing import Any

from mitsuba_endo.errors import InputError
from mitsuba_endo.rendering.axes import swap_axes
from mitsuba_endo.rendering.mitsuba_modules import dr, mi
from mitsuba_endo.rendering.rays import pixel_rays

from . import doe_projector
from .variants import is_scalar, variant_class

CHANNELS = ("projector.x", "projector.y", "depth", "visible", "camera")


class ProjectorCoords:
    r"""Image of projector coordinates (:monosp:`projector_coords`).

    .. pluginparameters::

     * - projector
       - |string|
       - Id of the ``doe_projector`` in the scene. (Default: the only one there is)

    One ray through every pixel centre (``spp`` and ``seed`` change nothing), so that no
    reconstruction filter blends coordinates. :py:func:`mi.render` returns a tensor of the shape
    (height, width, 5) of the film's crop window:

    ===========  ==================================================================================
    projector.x  pattern coordinate of the surface point, pattern pixels, integer = pixel centre;
    projector.y  NaN where the camera sees nothing, behind the projector and where its distortion
                 folds. Given outside the pattern and in the projector's shadow too.
    depth        z of the surface point in the camera's frame (along its optical axis), mm; NaN
                 where the camera sees nothing
    visible      1 where the projector lights the point: on the pattern, unoccluded, and the seen
                 side of the surface faces the projector; else 0
    camera       1 where the camera sees a surface, else 0
    ===========  ==================================================================================

    The first three are differentiable (forward and reverse) with respect to vertices, sensor,
    ``doe_projector`` and its pose, at fixed visibility: derivatives of occlusion boundaries are
    left out. Sensors must have a single centre of projection. Vectorised variants only.

    .. tabs::
        .. code-tab:: xml

            <integrator type="projector_coords">
                <string name="projector" value="projector"/>
            </integrator>

        .. code-tab:: python

            coordinates = mi.render(scene, integrator=mi.load_dict({'type': 'projector_coords'}))
    """

    def __init__(self, props: Any) -> None:
        mi.CppADIntegrator.__init__(self, props)
        self.projector = str(props.get("projector", ""))

    def aov_names(self) -> list[str]:
        return list(CHANNELS)

    def render(
        self,
        scene: Any,
        sensor: Any = 0,
        seed: Any = 0,
        spp: int = 0,
        develop: bool = True,
        evaluate: bool = True,
    ) -> Any:
        image = self._image(scene, sensor)
        if evaluate:
            dr.eval(image)
        return image

    def render_forward(
        self, scene: Any, params: Any, sensor: Any = 0, seed: Any = 0, spp: int = 0
    ) -> Any:
        with dr.resume_grad():
            image = self._image(scene, sensor)
            dr.forward_to(image)
            return dr.grad(image)

    def render_backward(
        self, scene: Any, params: Any, grad_in: Any, sensor: Any = 0, seed: Any = 0, spp: int = 0
    ) -> None:
        with dr.resume_grad():
            image = self._image(scene, sensor)
            dr.set_grad(image, grad_in)
            dr.enqueue(dr.ADMode.Backward, image)
            dr.traverse(dr.ADMode.Backward)

    def _image(self, scene: Any, sensor: Any) -> Any:
        if is_scalar():
            raise RuntimeError("projector_coords needs a vectorised variant, such as llvm_ad_rgb")
        sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        projector = find_projector(scene, self.projector)
        ray, width, height = pixel_rays(sensor)
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True)
        channels = self._channels(scene, sensor, projector, si)
        index = dr.arange(mi.UInt32, width * height)
        image = dr.zeros(mi.Float, width * height * len(CHANNELS))
        for i, channel in enumerate(channels):
            dr.scatter(image, channel, index * len(CHANNELS) + i, mode=dr.ReduceMode.Permute)
        return mi.TensorXf(image, (height, width, len(CHANNELS)))

    def _channels(self, scene: Any, sensor: Any, projector: Any, si: Any) -> list[Any]:
        seen = si.is_valid()
        # Arithmetic on a safe point where nothing is seen: 0 * inf would make derivatives NaN.
        point = dr.select(seen, si.p, projector.to_world @ mi.Point3f(0, 0, 1))
        u, v, _, reached = projector.project(point)
        _, _, depth = swap_axes(sensor.world_transform().inverse() @ point)
        lit = seen & reached & projector.inside(u, v)
        visible = lit & self._unoccluded(scene, projector, si, lit)
        nan = dr.nan
        return [
            dr.select(seen & reached, u, nan),
            dr.select(seen & reached, v, nan),
            dr.select(seen, depth, nan),
            dr.select(visible, mi.Float(1.0), 0.0),
            dr.select(seen, mi.Float(1.0), 0.0),
        ]

    def _unoccluded(self, scene: Any, projector: Any, si: Any, active: Any) -> Any:
        with dr.suspend_grad():
            origin = projector.to_world.translation()
            # The seen side must face the projector, or the light would pass through the surface.
            same_side = dr.dot(si.n, origin - si.p) * dr.dot(si.n, si.to_world(si.wi)) > 0
            return same_side & ~scene.ray_test(si.spawn_ray_to(origin), active & same_side)

    def to_string(self) -> str:
        return f"ProjectorCoords[projector = {self.projector or 'the only one'}]"


def find_projector(scene: Any, identifier: str = "") -> Any:
    """Return the scene's ``doe_projector`` of this id, or its only one.

    Raises:
        InputError: there is none, or several and no id was given.
    """
    found = [e for e in scene.emitters() if isinstance(e, doe_projector.plugin())]
    ids = [e.id() for e in found]
    if identifier:
        found = [e for e in found if e.id() == identifier]
    if len(found) == 1:
        return found[0]
    named = (
        f"no doe_projector with the id {identifier!r}" if identifier else "no single doe_projector"
    )
    raise InputError(
        f"the scene has {named} (it has: {', '.join(ids) or 'none'})",
        "projector_coords",
        "give the id of one of the scene's doe_projector emitters",
    )


def register(mi: Any) -> None:
    """Register the integrator for the active variant."""
    cls = variant_class(ProjectorCoords, "CppADIntegrator")
    mi.register_integrator("projector_coords", lambda props: cls(props))
