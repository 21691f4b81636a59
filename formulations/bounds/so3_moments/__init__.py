"""Bounds that hold for every unit revolute Jacobian: moment relaxations on SO(3)ⁿ.

A unit revolute joint, eq. (21), is a rotation, so a Jacobian is a point of SO(3)ⁿ and a bound
is a sum-of-squares identity among invariant polynomials there. The numbers that need it, all
for seven joints, in results/bounds and docs/bounds.md:

=====================================  ================================================
½‖JJᵀ − (7/3)I‖_F² ≥ 0.05682, proved   `residual_bound`, preset tight, rigorous; so do
                                       both bounds of `formulations.bounds.closed_form`
0.056826543, numerical                 preset tight
0.05665, both ways                     preset compact, the quickest
σ ≤ 0.572626, proved                   `max_min_bound`, preset localised, rigorous
σ ≤ 0.572277, numerical                preset null-vector
=====================================  ================================================

In reading order, first products of Wigner functions, sorted by the representations of all
symmetries: `wigner`, `row_sectors`, `symmetric_rows` by `young_basis`; then::

    sampled_blocks       moment matrices of these rows, evaluated at configurations
    localisers           blocks that are positive semidefinite where a condition holds
    moment_program       the semidefinite program, which `predictor_corrector` solves
    relaxation           what all bounds share: sample, solve, check the identity
    residual_bound       a lower bound on the residual; the result is a `global_bound`
    max_min_bound        an upper bound on the worst case, by `worst_case_conditions`
    null_vector_bound    with the signs of the columns fixed by the `null_vector`

and the proofs::

    certificate          the file of a rigorous bound, written and strictly read
    verification         the proof from that file, without solver and relaxation: sums with
                         bounds on all rounding (`enclosed_squares`, `enclosed_sums`)
                         at points that determine all `invariants`
    certifying           from a search to its certificate, and to what verification proves
"""
