"""Simulated photographs: tissue, light, and what a camera does to an image."""
