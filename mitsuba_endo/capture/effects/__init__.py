"""What a camera and a laser do to an image: one pure, seeded stage a file, joined in ``chain``."""

from .chain import apply_effects

__all__ = ["apply_effects"]
