"""From a fit to the solution that is saved."""
