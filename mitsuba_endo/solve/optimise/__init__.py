"""How it is minimised, and what an optimum looks like."""
