"""Joint estimation of surface, poses and projector from correspondence maps."""
