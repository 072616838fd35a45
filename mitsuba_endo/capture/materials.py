"""Tissue as Mitsuba materials."""

from typing import Any

import numpy as np

from ..rendering import keys
from ..rendering.mitsuba_modules import mi
from .diffusion import scattering_albedo
from .settings import Tissue


def opaque_tissue(tissue: Tissue) -> dict[str, Any]:
    """Return diffuse base, rough surface and wet film in one ``principled``."""
    wet = {
        "type": "principled", "base_color": _colour(tissue),
        "roughness": tissue.roughness, "specular": tissue.specular,
        "clearcoat": tissue.clearcoat, "clearcoat_gloss": tissue.clearcoat_gloss,
    }  # fmt: skip
    return {"type": "twosided", "bsdf": _with_relief(tissue, wet)}


def entering_part(tissue: Tissue) -> dict[str, Any]:
    """Return the parameters of opaque tissue for light that enters it: the diffuse base alone."""
    return _parameters(tissue, tissue.base_color, 0.0, 0.0)


def reflected_part(tissue: Tissue) -> dict[str, Any]:
    """Return those for light that does not enter: reflections of surface and film alone."""
    return _parameters(tissue, (0.0, 0.0, 0.0), tissue.specular, tissue.clearcoat)


def _parameters(
    tissue: Tissue, colour: tuple[float, float, float], specular: float, clearcoat: float
) -> dict[str, Any]:
    values = {
        f"base_color.{'base.' if tissue.vessel_contrast else ''}value": mi.Color3f(*colour),
        "specular": specular,
        "clearcoat.value": clearcoat,
    }
    return {keys.tissue(name, tissue.relief > 0): value for name, value in values.items()}


def translucent_tissue(tissue: Tissue) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the rough dielectric boundary and the homogeneous medium behind it.

    The medium scatters isotropically: by the similarity relation the reduced mean free path then
    stands for any phase function. Vessels are a thin absorbing layer, crossed twice.
    """
    boundary: dict[str, Any] = {
        "type": "roughdielectric", "distribution": "ggx", "alpha": tissue.roughness**2,
        "int_ior": index_of_refraction(tissue.specular), "ext_ior": 1.0,
    }  # fmt: skip
    if tissue.vessel_contrast:
        one = {"type": "rgb", "value": 1.0}
        boundary["specular_transmittance"] = _vessels(tissue, one, tissue.vessel_contrast / 2)
    albedo = [scattering_albedo(a, index_of_refraction(tissue.specular)) for a in tissue.base_color]
    medium = {
        "type": "homogeneous", "sigma_t": 1 / tissue.mean_free_path,
        "albedo": {"type": "rgb", "value": albedo}, "phase": {"type": "isotropic"},
    }  # fmt: skip
    return _with_relief(tissue, boundary), medium


def index_of_refraction(specular: float) -> float:
    """Return the index that reflects 0.08 ``specular`` at right angles, as ``principled`` has it.

    Never 1, where a dielectric is no boundary.
    """
    root = float(np.sqrt(0.08 * max(specular, 0.05)))
    return (1 + root) / (1 - root)


def _with_relief(tissue: Tissue, bsdf: dict[str, Any]) -> dict[str, Any]:
    if not tissue.relief:
        return bsdf
    fine = {"type": "tissue_relief", "slope": tissue.relief, "seed": tissue.seed}
    return {"type": "bumpmap", "relief": fine, "bsdf": bsdf}


def _colour(tissue: Tissue) -> dict[str, Any]:
    base = {"type": "rgb", "value": list(tissue.base_color)}
    return _vessels(tissue, base, tissue.vessel_contrast) if tissue.vessel_contrast else base


def _vessels(tissue: Tissue, base: dict[str, Any], contrast: float) -> dict[str, Any]:
    return {"type": "vessels", "base": base, "contrast": contrast,
            "scale": tissue.vessel_scale, "seed": tissue.seed}  # fmt: skip
