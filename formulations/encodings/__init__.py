"""How a statement about eigenvalues becomes a smooth program, with derivatives written out.

`factors` has encodings with auxiliary factors, `schur_complement` that without, and `columns`
the derivatives of a matrix whose columns depend on variables.
"""
