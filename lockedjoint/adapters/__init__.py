"""Failure tolerance inside other tools: one module for each, which imports that tool."""
