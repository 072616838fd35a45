"""From images of projected patterns to correspondence maps. NumPy and OpenCV only."""
