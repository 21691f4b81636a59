"""Many starts over formulations, models and sizes: declared, resumable, kept on disk."""
