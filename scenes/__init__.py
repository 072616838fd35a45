"""Scene descriptions of the package (installed as ``mitsuba_endo.scenes``)."""
