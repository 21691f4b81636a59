"""Bounds for every unit revolute Jacobian, by moment relaxations on SO(3)ⁿ (docs/bounds.md).

Definitions, which search and verifier share: `rotations` and `wigner` (functions of one joint),
`row_sectors` (their symmetries), `plain_rows`, `tableaux` and `symmetric_rows` (permutations of
joints), `plain_values` and `sampled_blocks` (blocks of the moment matrix at configurations),
`enclosed_matrix` (matrices with bounds on their errors), `conditions` (what a worst case
implies) and `lever_conditions` (what isotropy implies for any lever arms).
Search: `moment_program` (the semidefinite program), `predictor_corrector` and `solvers` (what
solves it), `concentrated_samples` (samples and units for the worst case), `relaxation` (from
blocks to a bound), `unit_revolute_bounds` (the three bounds).
File between them: `certificate` (what it is, and writing it) and `certificate_reader`.
Verifier: `verification`, with `row_rounding`, `enclosed_squares`, `block_values` and
`enclosed_sums` (sums at points, all rounding bounded), `characters` and `invariants` (which
points determine an invariant).
"""
