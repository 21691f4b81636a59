"""The moment relaxation of the existence of an optimally failure-tolerant Jacobian.

W = ZᵀZ is the complex symmetric matrix of `formulations.existence.equations`. A solution may be
averaged over the order of the joints, a common phase and conjugation, so its moments depend on
a graph only. They obey linear equations, and matrices of them are positive semidefinite. Where
no numbers do both, there is no solution. In reading order: `monomials`, `tableaux`, `moments`,
`relaxation`.
"""
