"""Plugins keep working when the variant is switched back and forth."""

import numpy as np

from mitsuba_endo import backend

SCENE = """<scene version="3.0.0">
    <sensor type="endoscope" id="camera">
        <float name="fx" value="30"/>
        <transform name="to_world"><lookat origin="1,0,-9" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/>
        </film>
    </sensor>
    <emitter type="doe_projector" id="projector">
        <float name="focal" value="30"/>
        <integer name="width" value="20"/><integer name="height" value="12"/>
        <float name="power" value="900"/>
        <transform name="to_world"><lookat origin="-1,0,-9" target="0,0,0" up="0,1,0"/></transform>
    </emitter>
    <shape type="sphere" id="surface"><float name="radius" value="3"/></shape>
    <integrator type="{integrator}"/>
</scene>"""


def brightness() -> float:
    import mitsuba as mi

    scene = mi.load_string(SCENE.format(integrator="direct"))
    assert len(scene.emitters()) == 1
    return float(np.mean(np.array(mi.render(scene, spp=4))))


def test_switching_variants_back_and_forth(llvm: str) -> None:
    """Oracle: the image of the first variant; without re-registration it would be black."""
    import mitsuba as mi

    first = brightness()
    assert first > 0.1
    for variant in ("scalar_rgb", "llvm_ad_mono", "scalar_rgb", "llvm_ad_rgb"):
        mi.set_variant(variant)
        assert abs(brightness() - first) < 0.02 * first  # Monte Carlo error of 4 samples a pixel
    coordinates = mi.render(mi.load_string(SCENE.format(integrator="projector_coords")))
    assert coordinates.shape == (16, 24, 5)
    backend.use("llvm_ad_rgb")
