"""Bounds that hold for every unit revolute Jacobian: moment relaxations on SO(3)ⁿ.

A unit revolute joint, eq. (21), is a rotation, so a Jacobian is a point of SO(3)ⁿ and a bound
is a sum-of-squares identity among invariant polynomials there. What needs it, of seven joints:
½‖JJᵀ − (7/3)I‖_F² ≥ 0.05682, and with it both bounds of
`lockedjoint.formulations.bounds.closed_form` on free lever arms, and σ ≤ 0.572277
(results/bounds, docs/bounds.md).

In reading order: `wigner`, `symmetric_rows`, `sampled_blocks`, `moment_program`, which
`predictor_corrector` solves, `relaxation` and `unit_revolute_bounds`. What a worst case
implies, with error bounds: `conditions`, of `enclosed_matrix`. The proofs: `certificate`, the
file of a rigorous bound, and `verification`, without solver and relaxation: sums with bounds on
all rounding (`enclosed_squares`, `enclosed_sums`) at points that determine all `invariants`.
"""
