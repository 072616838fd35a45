"""What a fit says about its own model: what its residuals hold beside noise, and why."""
