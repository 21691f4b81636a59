"""The exact proof that no optimally failure-tolerant 7R Jacobian exists."""
