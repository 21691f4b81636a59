"""The study of bounds."""
