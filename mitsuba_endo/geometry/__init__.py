"""Transforms, lens distortion, camera models and projection models.

Formulas are written once over components (x, y, z) and run on NumPy arrays and on Dr.Jit
arrays alike (see :mod:`.arrays`); nothing here imports Mitsuba.
"""
