"""Moment matrices and localisers, evaluated at configurations.

sampled_blocks     blocks averaged over all symmetries
localisers         conditions g(x) ≥ 0, and J_f J_fᵀ ⪰ tI on j_f, M j_f, M² j_f
enclosed_squares   sums of squares with bounds on all errors
invariants         how many there are, and a bound on one everywhere from values at points
"""
