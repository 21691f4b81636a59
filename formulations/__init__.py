"""Failure-tolerant manipulator Jacobians: models, measures, statements, bounds, proof."""
