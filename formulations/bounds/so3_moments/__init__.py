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

In reading order::

    wigner                 Wigner functions, their coupling, and which products are rows
    symmetric_rows         the rows sorted by all symmetries, with bases of `tableaux`
    sampled_blocks         moment matrices of these rows, and localisers, at configurations
    moment_program         the semidefinite program, which `predictor_corrector` solves
    relaxation             what all bounds share: sample, solve, check the identity or prove it
    null_vector_bound      a worst case excluded with the signs of the columns, by
                           `null_vector_conditions`
    unit_revolute_bounds   both bounds

and the proofs::

    certificate            the file of a rigorous bound, written and strictly read
    verification           the proof from that file, without solver and relaxation: sums with
                           bounds on all rounding (`enclosed_squares`, `enclosed_sums`)
                           at points that determine all `invariants`
"""
