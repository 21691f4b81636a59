"""Bounds that hold for every unit revolute Jacobian: moment relaxations on SO(3)ⁿ.

A unit revolute joint, eq. (21), is a rotation, so a Jacobian is a point of SO(3)ⁿ and a bound
is a sum-of-squares identity among invariant polynomials there. Read the files in this order:

    wigner, clebsch_gordan   functions of one joint, and how spins couple
    row_sectors              which products are taken, by what the symmetries do to them
    permuted_rows            permutations and conjugation of the rows
    young_basis              bases in which permutations act in Young's orthogonal form
    adapted_rows             rows sorted into blocks
    sampled_blocks           blocks evaluated at configurations, averaged over all symmetries
    plain_average            the same by a longer road
    presets                  the choices of rows
    moment_program           the semidefinite program in the pseudo-moments
    cvxpy_solver             … solved by a general conic solver
    predictor_corrector      … solved by a dense method made for its shape
    identity_check           the identity at fresh configurations
    residual_bound           a lower bound on the residual, numerical

    rounding                 bounds on rounding errors, worked out beforehand
    enclosed_squares         sums of squares with bounds on all errors
    invariant_dimension      how many invariants there are, counted exactly
    invariant_basis          a bound on an invariant everywhere from values at points
    dual_refinement          multipliers that satisfy the equations to the last digits
    rigorous_residual        a lower bound on the residual that is a theorem

    spectral_limits          what a worst case demands of the eigenvalues of JJᵀ
    max_min_bound            an upper bound on the worst case, in closed form
    matrix_localisers        conditions J_f J_fᵀ ⪰ tI
    krylov_localisers        conditions J_f J_fᵀ ⪰ tI on j_f, M j_f, M² j_f
    plain_localisers         the same by a longer road
    scaled_blocks            conditions ρ ≤ ρ_max(t)
    feasibility_margin       how far conditions are from being met
    fixed_worst_case         all conditions of a worst case together

    global_bound             what was found, `GlobalBound`
"""
