"""Bounds that hold for every unit revolute Jacobian: moment relaxations on SO(3)ⁿ.

A unit revolute joint, eq. (21), is a rotation, so a Jacobian is a point of SO(3)ⁿ and a bound
is a sum-of-squares identity among invariant polynomials there. Read `representations`, `blocks`
and `programs` in this order, then:

    relaxation           what all bounds share: sample, solve, collect the evidence
    global_bound         the result, `GlobalBound`
    residual_bound       a lower bound on the residual, numerical
    rigorous_identity    an identity with multipliers, all rounding bounded
    rigorous_residual    a lower bound on the residual that is a theorem
    fixed_worst_case     the conditions that a worst case implies, and its exclusion
    rigorous_max_min     the same as a theorem
    null_vector_bound    exclusion with the signs of the columns fixed by the null vector
    max_min_bound        an upper bound on the worst case
    certificate          the file of a rigorous bound; `reading` reads it strictly
    verification         the proof from that file, without solver and relaxation
"""
