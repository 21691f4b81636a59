"""Products of Wigner functions, sorted by the representations of all symmetries.

wigner          functions of one joint, and the coupling of spins
row_sectors     which products are taken, by their behaviour under the symmetries
permuted_rows   permutations and conjugation of the rows
young_basis     bases in which permutations act in Young's orthogonal form
adapted_rows    rows sorted into blocks
rounding        a-priori bounds on rounding errors
"""
