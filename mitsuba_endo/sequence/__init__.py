"""Frames of a video, one after the other: tracked against one map that grows with them."""
