"""From starts of the frames to problems, and which frames belong together."""
