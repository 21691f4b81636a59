"""The best values that unit revolute Jacobians are known to reach."""

from __future__ import annotations

from math import sqrt

# Minima of ½‖JJᵀ − (n/3)I‖_F². Isotropic Jacobians exist for n = 6 and n ≥ 8.
_RESIDUAL = {6: 0.0, 7: 0.05682654575, 8: 0.0, 9: 0.0}
# Maxima of the worst case (5); for n = 8 and 9 the bound (6) is reached.
_MAX_MIN = {6: 0.0, 7: 0.571482968, 8: sqrt(2 / 3), 9: 1.0}


def best_known_residual(joints: int) -> float | None:
    """Return the smallest known ½‖JJᵀ − (n/3)I‖_F², to 11 decimals, or None."""
    return _RESIDUAL.get(joints)


def best_known_max_min(joints: int) -> float | None:
    """Return the largest known worst-case singular value; None if not recorded."""
    return _MAX_MIN.get(joints)
