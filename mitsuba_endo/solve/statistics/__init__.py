"""What the data tell about the unknowns, and what they cannot."""
