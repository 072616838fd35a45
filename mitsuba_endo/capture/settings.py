"""What a simulated photograph is made of: tissue, light, camera effects."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..records.validation import Record

Share = Annotated[float, Field(ge=0, le=1)]
NonNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Colour = tuple[Share, Share, Share]


class Tissue(Record):
    """Wet tissue under a film of mucus. Works on any mesh: nothing needs texture coordinates."""

    base_color: Colour = (0.72, 0.36, 0.30)
    """Diffuse albedo between vessels, linear RGB."""
    roughness: Annotated[float, Field(ge=0.05, le=1)] = 0.4
    """Of the surface, Mitsuba's ``principled`` (its square is the GGX width)."""
    specular: Share = 0.5
    """Reflection of the surface at right angles, 0 to 8 % (0.5 = 4 %, index 1.5)."""
    clearcoat: Share = 0.6
    """Strength of the wet film's own sharp reflection."""
    clearcoat_gloss: Share = 0.9
    """Sharpness of that reflection."""
    vessel_contrast: Share = 0.5
    """Light that the middle of a vessel takes from green and blue; 0 = no vessels."""
    vessel_scale: Positive = 6.0
    """Mean distance of the larger vessels, mm."""
    relief: NonNegative = 0.15
    """Slope (root mean square) of fine relief that breaks the reflections; it bends the shading
    normal and leaves the geometry as it is."""
    subsurface: Literal["none", "blur", "medium"] = "blur"
    """Light inside the tissue: ``none``; ``blur``, a fast approximation on the image; ``medium``,
    a participating medium under a rough dielectric boundary. The medium is slow, and free of noise
    with a thousand samples a pixel only. It returns 10 to 15 % less green and blue light than
    ``blur`` and 25 to 30 % less red: its boundary reflects a share that ``blur`` lets in, and walks
    end after 256 scatterings, which takes a sixth of the light where the albedo is 0.997."""
    mean_free_path: Positive = 0.25
    """Reduced (transport) mean free path in the tissue, mm."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Chooses the vessels and the fine relief."""


class Light(Record):
    """The laser's pattern and the endoscope's own lamp."""

    projector_power: Positive = 3000.0
    """Radiant power of the whole pattern, arbitrary units (radiance is in these per mm² sr)."""
    lamp: NonNegative = 0.0
    """Radiant intensity of the lamp relative to the pattern's mean one on the projector's axis;
    0 = off."""
    lamp_color: Colour = (1.0, 0.95, 0.88)
    """Linear RGB."""
    lamp_offset: NonNegative = 2.5
    """Distance of the two light guides' ends from the camera's centre, left and right, mm."""


class Effects(Record):
    """What camera and laser do to the image, stage by stage in this order.

    Lens distortion is no stage: the sensor ``endoscope`` renders through the lens model itself.
    """

    vignetting: NonNegative = 1.0
    """Power of the natural falloff: cos(angle to the axis)^(4 vignetting); 0 = none."""
    defocus: NonNegative = 0.6
    """Standard deviation of the Gaussian point spread, pixels."""
    motion: NonNegative = 0.0
    """Way of the image during the exposure, pixels."""
    motion_angle: float = 0.0
    """Direction of that way, radians from +x towards +y."""
    speckle_contrast: Share = 0.2
    """Standard deviation of the laser speckle over its mean; 1 = fully developed, 0 = none."""
    speckle_grain: Annotated[float, Field(ge=1)] = 2.0
    """Full width at half maximum of the speckle's autocovariance, pixels."""
    auto_exposure: bool = True
    """Let ``exposure`` be relative to the one at which the 99.5th percentile of the brightest
    channel is at full scale; else it is the factor from radiance to full scale itself."""
    exposure: Positive = 1.0
    """Exposure; what exceeds full scale is clipped."""
    colour: Literal["colour", "gray"] = "colour"
    """Three channels, or one of the luminance (Rec. 709)."""
    shot: Positive | None = 8000.0
    """Electrons at full scale, for shot and read noise; None = no noise."""
    read_noise: NonNegative = 12.0
    """Standard deviation of the read noise, electrons."""
    gamma: Positive = 2.2
    """Encoded value = linear value^(1 / gamma)."""
    bits: Literal[8, 16] = 8
    """Of the encoded image."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] | None = None
    """Quality of JPEG compression (8 bits only); None = none."""

    @model_validator(mode="after")
    def _jpeg_has_8_bits(self) -> "Effects":
        if self.jpeg_quality is not None and self.bits != 8:
            raise ValueError("jpeg_quality is given with 16 bits; give bits: 8 or no jpeg_quality")
        return self


class CaptureSettings(Record):
    """Everything that a photograph depends on besides geometry, pattern and seed."""

    tissue: Tissue = Tissue()
    light: Light = Light()
    effects: Effects = Effects()
    spp: Annotated[int, Field(ge=1)] = 16
    """Samples per pixel."""
    max_depth: Annotated[int, Field(ge=2)] = 4
    """Longest light path: 2 = direct light only, each more adds a reflection in the lumen."""
