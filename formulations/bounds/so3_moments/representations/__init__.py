"""Functions of one joint on SO(3), and rows adapted to the symmetries."""
