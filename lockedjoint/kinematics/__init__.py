"""Robots as chains of joints: read, forward and inverse kinematics, self-motion."""
