"""Joint estimation of surface, poses and projector from correspondence maps."""

from .. import backend

# Modules of this room import Dr.Jit, which looks for LLVM then and never again.
backend.locate_llvm()
