"""Target-free calibration of camera-projector pairs by differentiable rendering."""

__version__ = "0.1.0"
