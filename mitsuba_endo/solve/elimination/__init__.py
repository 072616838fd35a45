"""Normal equations, sparse over surfaces and dense over the other unknowns, and their solution."""
