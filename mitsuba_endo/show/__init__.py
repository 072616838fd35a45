"""Pictures of a calibration and the folder that holds its result."""
