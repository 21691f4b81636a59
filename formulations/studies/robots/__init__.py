"""Arms that exist: the best posture of each, and how much of what is possible it is."""
