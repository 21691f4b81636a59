"""The semidefinite programs in the pseudo-moments, and checks of their multipliers."""
