"""Bounds on what any Jacobian can reach: a closed form, and semidefinite relaxations."""
