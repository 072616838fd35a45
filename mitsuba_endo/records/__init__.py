"""Typed records that pass between the stages, each with its file format."""
