"""Bounds that hold for every unit revolute Jacobian: moment relaxations on SO(3)ⁿ.

A unit revolute joint, eq. (21), is a rotation, so a Jacobian is a point of SO(3)ⁿ and a bound
is a sum-of-squares identity among invariant polynomials there. The numbers that need it, all
for seven joints, in results/bounds and docs/bounds.md:

=====================================  ================================================
½‖JJᵀ − (7/3)I‖_F² ≥ 0.05682, proved   `residual_bound`, preset tight, rigorous; so do
                                       both bounds of `formulations.bounds.free_levers`
0.056826543, numerical                 preset tight
0.05665, both ways                     preset compact, the quickest
σ ≤ 0.572626, proved                   `max_min_bound`, preset localised, rigorous
σ ≤ 0.572277, numerical                preset null-vector
=====================================  ================================================

Read `representations`, `blocks` and `programs` in this order, then:

    relaxation           what all bounds share: sample, solve, collect the evidence
    global_bound         the result, `GlobalBound`
    residual_bound       a lower bound on the residual
    fixed_worst_case     the conditions that a worst case implies, and its exclusion
    null_vector_bound    exclusion with the signs of the columns fixed by the null vector
    max_min_bound        an upper bound on the worst case
    certificate          the file of a rigorous bound; `reading` reads it strictly
    verification         the proof from that file, without solver and relaxation
    certifying           from a search to its certificate, and to what verification proves
"""
