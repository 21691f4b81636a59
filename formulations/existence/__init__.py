"""The exact proof that no optimally failure-tolerant 7R Jacobian exists.

Derivation, each file on the one before: `graphs` (monomials as coloured graphs), `polynomials`,
`equations` (of isotropic Jacobians), `rewriting` (division by the equations), `young` (the
squares), `derive`. Judgement, sharing no mathematics with it: `certificate` (the records),
`reading` (the file), `verify` (by expansion), `evaluate` (at random matrices).

The proof on paper is docs/nonexistence.md.
"""
