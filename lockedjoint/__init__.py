"""lockedjoint: design and certify optimally failure-tolerant manipulator Jacobians."""

__version__ = "0.1.0"
