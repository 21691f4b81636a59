"""Moment matrices and localisers, evaluated at configurations."""
