"""The moment relaxation of the existence of an optimally failure-tolerant Jacobian.

W = ZᵀZ is the complex symmetric matrix of `formulations.existence.equations`. A solution may be
averaged over the order of the joints, a common phase and conjugation, so its moments depend on
a graph only; they obey linear equations, and matrices of them are positive semidefinite. Where
no numbers do both, there is no solution. Read the files in this order:

    exact_elimination      linear equations over the rationals
    linear_moments         what the equations leave free of the moments
    edge_multisets         monomials as numbers
    moment_table           from pairs of monomials to their class, by array look-up
    row_sectors            rows of the moment matrix, by charge
    tableaux               one standard tableau per irreducible representation
    symmetry_adapted_rows  rows of the moment matrix, one small set per representation
    equation_rows          rows that the equations send to zero
    moment_matrix          the moment matrix through a few combinations of its rows
    moment_blocks          the blocks, as functions of the free moments
    margin_sdp             the largest smallest eigenvalue that is possible
    margin_certificate     its check, in plain NumPy
    outcome                what was found, `ExistenceRelaxation`
    relaxation             all of it: `existence_relaxation`
"""
