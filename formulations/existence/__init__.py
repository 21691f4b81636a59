"""The exact proof that no optimally failure-tolerant 7R Jacobian exists.

Derivation, each file on the one before: `graphs` (monomials as coloured graphs), `equations`
(polynomials, and the equations of isotropic Jacobians), `rewriting` (division by the
equations), `derive` (the two squares). Verification, which shares no mathematics with it:
`certificate` (the records), `reading` (the file), `verify` (by expansion), `evaluate` (at
random matrices). `theorem` has the result for other modules, `relaxation` the moments.

The proof on paper is docs/nonexistence.md.
"""
