"""For which n optimally failure-tolerant nR Jacobians exist: exact proofs.

That none exists for n = 7:

Derivation: `equations` (monomials as coloured graphs, polynomials, and the equations of
isotropic Jacobians), `derive` (the two squares, divided by the equations). Verification, which
shares no mathematics with it: `certificate` (the records), `reading` (the file), `verify` (by
expansion, and at random matrices), which has the result for other modules. `relaxation` is a
semidefinite program over moments, in bases of `tableaux`.

That they exist for every n ≥ 8: `rings` has them in closed form and writes certificates,
`exact_jacobian` has the records of those and verifies them.

The proofs on paper are docs/nonexistence.md and docs/existence.md.
"""
