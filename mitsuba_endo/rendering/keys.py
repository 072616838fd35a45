"""Mitsuba's parameter names: the only module that spells them.

Scenes give their optimised objects the ids below; a parameter's key is the id and its name.
"""

from ..geometry.cameras import CAMERAS

CAMERA = "camera"
"""Id of the ``endoscope`` sensor."""
PROJECTOR = "projector"
"""Id of the ``doe_projector`` emitter."""
SURFACE = "surface"
"""Id of the mesh that is seen, and solved for."""
LAMP = "lamp"
"""Beginning of the ids of the endoscope's own light guides."""

DISTORTION = ("k1", "k2", "p1", "p2", "k3")
"""Names of the projector's distortion, in OpenCV's order."""
VERTEX_POSITIONS = "vertex_positions"
"""Name of a mesh's flat (3 V) vertex positions where the mesh itself is traversed."""
FACES = "faces"
"""Name of a mesh's flat (3 F) vertex indices where the mesh itself is traversed."""


def vertex_positions(shape: str = SURFACE) -> str:
    """Return the key of a mesh's flat (3 V) vertex positions."""
    return f"{shape}.{VERTEX_POSITIONS}"


def faces(shape: str = SURFACE) -> str:
    """Return the key of a mesh's flat (3 F) vertex indices."""
    return f"{shape}.{FACES}"


def vertex_texcoords(shape: str = SURFACE) -> str:
    """Return the key of a mesh's flat (2 V) texture coordinates, empty if it has none."""
    return f"{shape}.vertex_texcoords"


def tissue(name: str, relief: bool) -> str:
    """Return the key of a parameter of the ``principled`` tissue of simulated photographs.

    It lies in a ``twosided`` material of the surface, and in a ``bumpmap`` if there is relief.
    """
    return f"{SURFACE}.bsdf.brdf_0.{'nested_bsdf.' if relief else ''}{name}"


def sampling_weight(emitter: str) -> str:
    """Return the key of how often an emitter is chosen relative to others; 0 = off."""
    return f"{emitter}.sampling_weight"


def to_world(identifier: str) -> str:
    """Return the key of a sensor's or emitter's pose, in Mitsuba's axes (see :mod:`.axes`)."""
    return f"{identifier}.to_world"


def position(identifier: str) -> str:
    """Return the key of a point light's place in the world."""
    return f"{identifier}.position"


def intrinsics(camera: str = CAMERA) -> tuple[str, str, str, str]:
    """Return the keys of fx, fy, cx, cy, pixels."""
    return f"{camera}.fx", f"{camera}.fy", f"{camera}.cx", f"{camera}.cy"


def lens(model: str, camera: str = CAMERA) -> tuple[str, ...]:
    """Return the keys of the camera's coefficients, in the order of its model."""
    return tuple(f"{camera}.{name}" for name in CAMERAS[model].coefficients)


def film_size(camera: str = CAMERA) -> str:
    """Return the key of the film's (width, height)."""
    return f"{camera}.film.size"


def focal(projector: str = PROJECTOR) -> str:
    """Return the key of the projector's focal length, pattern pixels."""
    return f"{projector}.focal"


def centre(projector: str = PROJECTOR) -> tuple[str, str]:
    """Return the keys of the projector's centre, pattern pixels."""
    return f"{projector}.centre_x", f"{projector}.centre_y"


def aspect(projector: str = PROJECTOR) -> str:
    """Return the key of the projector's aspect fy / fx."""
    return f"{projector}.aspect"


def distortion(projector: str = PROJECTOR) -> tuple[str, ...]:
    """Return the keys of the projector's distortion, in OpenCV's order."""
    return tuple(f"{projector}.{name}" for name in DISTORTION)
