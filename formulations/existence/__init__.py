"""For which n optimally failure-tolerant nR Jacobians exist: exact proofs.

nR means n revolute joints. None exists for n = 7: `derive` divides two squares by the
`equations`, `verify` checks the file (`certificate`, `reading`) by expansion, and shares no
mathematics with it; `coq_data` writes it for the proof assistant Coq. Some exist for every n ≥
8: `rings` has them in closed form, `exact_jacobian` verifies certificates of them. The proofs
on paper are docs/nonexistence.md and docs/existence.md.
"""
