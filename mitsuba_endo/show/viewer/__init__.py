"""The live 3D viewer; the only room that knows viser."""
