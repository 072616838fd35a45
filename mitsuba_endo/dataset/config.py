"""The configuration of a dataset: what scenes, cameras, projectors and photographs to draw."""

from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

from ..geometry.cameras import CAMERAS
from ..geometry.projection_models import PROJECTION_MODELS
from ..reading.trees import read_yaml
from ..records.validation import validate
from .capture_ranges import CaptureRanges
from .ranges import (
    Count,
    Degrees,
    Names,
    NonNegative,
    Number,
    Positive,
    Range,
    Section,
    Share,
    choose,
    fixed,
    log,
    uniform,
)
from .scene_ranges import Scene, default_scenes

Seed = Annotated[int, Field(ge=0)]


def _among(range_: Range, names: Any, what: str) -> Range:
    for value in range_.values:
        if value not in names:
            raise ValueError(f"unknown {what} '{value}'; choose from {', '.join(names)}")
    return range_


class PoseRules(Section):
    """What a drawn view must fulfil; views that do not are drawn again."""

    margin: PositiveFloat = 2.0
    """Least distance of camera and projector from the surface, mm."""
    least_lit: Annotated[float, Field(gt=0, le=1)] = 0.15
    """Least share of the image's pixels that the projector lights."""
    tries: PositiveInt = 200
    """Views drawn before the sample is given up and recorded as failed."""


class CameraRanges(Section):
    """The camera."""

    model: Names = fixed("opencv")
    width: PositiveInt = 320
    height: PositiveInt = 240
    """Pixels, the same for all samples."""
    fov: Degrees = uniform(50.0, 72.0)
    """From left to right without distortion."""
    aspect: Positive = uniform(0.995, 1.005)
    """fy / fx."""
    centre: Number = uniform(-5.0, 5.0)
    """Principal point from the image's middle along each axis, pixels."""
    distortion: list[Number] = [
        uniform(-0.2, 0.0), uniform(0.0, 0.03),
        uniform(-0.001, 0.001), uniform(-0.001, 0.001),
    ]  # fmt: skip
    """Coefficients in the model's OpenCV order."""

    @field_validator("model")
    @classmethod
    def _known_model(cls, value: Range) -> Range:
        return _among(value, CAMERAS, "camera model")

    @field_validator("fov")
    @classmethod
    def _sensible_fov(cls, value: Range) -> Range:
        if min(value.values) < 5 or max(value.values) > 170:
            raise ValueError("is out of range; stay within 5 and 170 degrees")
        return value

    @model_validator(mode="after")
    def _coefficients(self) -> "CameraRanges":
        for model in self.model.values:
            if len(self.distortion) not in CAMERAS[model].max_coefficients:
                allowed = ", ".join(map(str, CAMERAS[model].max_coefficients))
                raise ValueError(
                    f"{len(self.distortion)} distortion coefficients do not fit model {model}; "
                    f"give one of {allowed}"
                )
        return self


class ProjectorRanges(Section):
    """The pattern projector in the endoscope's channel."""

    law: Names = choose("direction_cosine", "pinhole")
    focal: Positive = uniform(280.0, 380.0)
    """Pattern pixels."""
    centre: Number = uniform(-3.0, 3.0)
    """Principal point from the pattern's middle along each axis, pattern pixels."""
    aspect: Positive = fixed(1.0)
    """fy / fx."""
    distortion: list[Number] = []
    """k1, k2, p1, p2, k3 on the law's normalised coordinates."""
    baseline: Positive = uniform(3.5, 8.0)
    """Distance of the channel's axis from the camera's, mm."""
    bearing: Degrees = uniform(-180.0, 180.0)
    """Direction of the channel from the camera, from +x towards +y."""
    ahead: Number = uniform(-1.0, 4.0)
    """How far the projector is pushed beyond the camera, mm."""
    meeting: Positive = log(40.0, 400.0)
    """Distance at which the projector's axis would meet the camera's, mm, before ``tilt``."""
    tilt: Degrees = uniform(-4.0, 4.0)
    """Error of the axis' direction about the projector's x and y axes."""
    roll: Degrees = uniform(-25.0, 25.0)
    """About its own axis."""

    @field_validator("law")
    @classmethod
    def _known_law(cls, value: Range) -> Range:
        return _among(value, PROJECTION_MODELS, "projection model")

    @field_validator("distortion")
    @classmethod
    def _few(cls, value: list[Range]) -> list[Range]:
        if len(value) > 5:
            raise ValueError(f"{len(value)} coefficients; give k1, k2, p1, p2, k3 at most")
        return value


class PatternRanges(Section):
    """The coded grid: ranges of the parameters of :class:`~mitsuba_endo.decoding.CodedGrid`."""

    variants: PositiveInt = 16
    """Different patterns in the dataset; each is drawn once and used by many samples."""
    width: Annotated[int, Field(ge=2, le=8192)] = 384
    """Pattern pixels; wider than columns x period leaves a band of stray light beside the grid."""
    height: Annotated[int, Field(ge=2, le=8192)] = 384
    columns: Count = fixed(32)
    rows: Count = fixed(32)
    period: Positive = fixed(12.0)
    """Pattern pixels."""
    line: Positive = uniform(0.05, 0.075)
    """Standard deviation of a line's profile, periods."""
    step: Positive = uniform(0.26, 0.3)
    """Height of a code's step, periods."""
    codes: Count = uniform(0, 999_999)
    """Seeds of the code sequence. Keep test sets apart from training sets by other codes."""
    background: Share = uniform(0.01, 0.06)
    """Stray light between the lines, relative to them."""
    zero_order: NonNegative = uniform(0.0, 2.0)
    """Brightness of the undiffracted beam, relative to the lines."""
    zero_order_size: Positive = uniform(1.5, 4.0)
    """Its standard deviation, pattern pixels."""
    colour: Names = fixed("green")
    oversample: Annotated[int, Field(ge=1, le=8)] = 2
    """Texels per pattern pixel."""


class StoreOptions(Section):
    """What is kept of each sample besides image and maps."""

    radiance: bool = True
    """The noise-free linear image, float16."""
    surface: bool = True
    """The mesh, with which a calibrated surface is compared."""


class Config(Section):
    """Contents of a dataset's configuration file. Everything has a default."""

    seed: Seed = 0
    """With the sample's number it decides everything about the sample."""
    format: Literal["files", "hdf5"] = "files"
    """A folder of files a sample, for people; or HDF5 shards, for training."""
    shard: Annotated[int, Field(ge=1, le=100_000)] = 100
    """Samples in an HDF5 shard."""
    store: StoreOptions = StoreOptions()
    scenes: Annotated[list[Scene], Field(min_length=1)] = Field(default_factory=default_scenes)
    placing: PoseRules = PoseRules()
    camera: CameraRanges = CameraRanges()
    projector: ProjectorRanges = ProjectorRanges()
    pattern: PatternRanges = PatternRanges()
    capture: CaptureRanges = CaptureRanges()


def load_config(path: str | Path | None) -> Config:
    """Read a configuration file; None gives the built-in one. Scene files are found beside it.

    Raises:
        InputError: names the file and field.
    """
    if path is None:
        return Config()
    path = Path(path)
    config = validate(Config, read_yaml(path), str(path))
    scenes = [
        scene
        if scene.file is None
        else scene.model_copy(update={"file": str((path.parent / scene.file).absolute())})
        for scene in config.scenes
    ]
    return config.model_copy(update={"scenes": scenes})


def example_config() -> str:
    """Return the packaged example: the built-in configuration, explained line by line."""
    return (
        resources.files("mitsuba_endo.dataset").joinpath("example.yaml").read_text(encoding="utf-8")
    )
