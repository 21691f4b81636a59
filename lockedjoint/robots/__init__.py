"""Robots that exist: from a URDF to a Jacobian, its failure tolerance and a better posture."""
