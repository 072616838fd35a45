"""Refinement of decoded coordinates on the image itself."""
