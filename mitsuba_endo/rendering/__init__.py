"""Scenes, projector coordinates and captures, rendered by Mitsuba."""

from .. import backend

# Modules of this room import Dr.Jit, which looks for LLVM then and never again.
backend.locate_llvm()
