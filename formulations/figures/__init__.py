"""Figures of what is computed: one per file, listed in `catalogue`."""
