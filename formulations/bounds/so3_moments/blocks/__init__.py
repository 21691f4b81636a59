"""Moment matrices and localisers, evaluated at configurations.

sampled_blocks        blocks averaged over all symmetries
localisers            conditions g(x) ≥ 0, and J_f J_fᵀ ⪰ tI on j_f, M j_f, M² j_f
enclosed_squares      sums of squares with bounds on all errors
invariant_dimension   how many invariants there are, counted exactly
invariant_basis       a bound on an invariant everywhere from values at points
"""
