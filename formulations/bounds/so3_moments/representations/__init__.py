"""Products of Wigner functions, sorted by the representations of all symmetries.

In reading order: `wigner`, `row_sectors`, `permuted_rows`, `young_basis`, `adapted_rows`,
`rounding`.
"""
