"""How a statement about eigenvalues becomes a smooth program, with derivatives written out."""
