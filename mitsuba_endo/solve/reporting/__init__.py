"""From a fit to the solution that is saved: units, estimates, warnings, verdict."""
