"""Moment matrices and localisers, evaluated at configurations, and sums of their squares."""
