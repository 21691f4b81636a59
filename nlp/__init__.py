"""The engine: nonlinear programs, Ipopt, many starts. Knows nothing of robots."""
