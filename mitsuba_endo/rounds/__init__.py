"""Photographs calibrated, read again with what the calibration says, and calibrated anew."""
