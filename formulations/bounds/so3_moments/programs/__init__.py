"""The semidefinite programs in the pseudo-moments, their solution and their multipliers."""
