"""Many starts over a declared grid, kept on disk: declaration → run → records → tables."""
