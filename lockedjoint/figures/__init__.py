"""Figures of what is computed, one per file: `figures` lists them by name, `values` by type."""
