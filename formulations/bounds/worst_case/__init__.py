"""Eq. (6) as a semidefinite program: problem, program, certificate, bound."""
