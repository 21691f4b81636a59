"""Check a sum-of-squares identity at configurations that the solver has not seen.

    objective(x) − bound = Σ ⟨X, B(x)⟩   for all configurations x, with every X ⪰ 0

proves objective ≥ bound. What is left over at fresh configurations is subtracted from the
bound. That is numerical evidence, no proof: between the configurations nothing is known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from formulations.bounds.so3_moments.blocks.block_family import BlockFamily
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats


@dataclass(frozen=True)
class IdentityCheck:
    """How well a sum-of-squares identity holds.

    Parameters
    ----------
    bound
        The bound that was checked, before anything is subtracted.
    leftover
        Largest difference of the two sides at the fresh configurations.
    configurations
        Number of fresh configurations.
    plain_leftover
        The same at configurations where the right-hand side was averaged over all orders of
        the joints one by one, with Wigner functions found in another way; None if not done.
    plain_configurations
        Number of these.
    """

    bound: float
    leftover: float
    configurations: int
    plain_leftover: float | None
    plain_configurations: int

    @property
    def checked_bound(self) -> float:
        """The bound minus the largest difference that was seen."""
        return self.bound - max(self.leftover, self.plain_leftover or 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON."""
        return {
            "unchecked_bound": self.bound,
            "leftover": self.leftover,
            "fresh_configurations": self.configurations,
            "plain_average_leftover": self.plain_leftover,
            "plain_average_configurations": self.plain_configurations,
        }


def check_identity(
    families: Sequence[BlockFamily],
    multipliers: Sequence[Floats],
    bound: float,
    objective: Callable[[Floats], Floats],
    fresh: Floats,
    plain_fresh: Floats | None = None,
    plain_sum: Callable[[BlockFamily, Floats, Sequence[Floats]], Floats] | None = None,
) -> IdentityCheck:
    """Evaluate both sides of the identity.

    Parameters
    ----------
    families
        The blocks, family by family.
    multipliers
        X of each block, positive semidefinite, in the order of the families.
    bound
        The constant on the left.
    objective
        Its values at rotations (configurations, n, 3, 3).
    fresh
        Rotations of configurations that were not used to find the multipliers.
    plain_fresh, plain_sum
        Further ones, and the second way to evaluate the sum of squares there.
    """
    squares = np.zeros(len(fresh))
    plain = None if plain_fresh is None else np.zeros(len(plain_fresh))
    start = 0
    for family in families:
        own = list(multipliers[start : start + len(family.sizes)])
        start += len(own)
        for x, block in zip(own, family.evaluate(fresh), strict=True):
            squares += np.tensordot(block, x, axes=2)
        if plain is not None and plain_fresh is not None and plain_sum is not None:
            plain += plain_sum(family, plain_fresh, own)
    leftover = float(np.abs(objective(fresh) - bound - squares).max())
    if plain is None or plain_fresh is None:
        return IdentityCheck(bound, leftover, len(fresh), None, 0)
    plain_leftover = float(np.abs(objective(plain_fresh) - bound - plain).max())
    return IdentityCheck(bound, leftover, len(fresh), plain_leftover, len(plain_fresh))
