"""How a statement about eigenvalues becomes a smooth program.

``factors``
    auxiliary triangular factors, for any number of locked joints;
``schur_complement``
    no auxiliary variables, derivatives written out, for one locked joint;
``columns``
    derivatives of what is made of J(x), in matrix operations.
"""
