"""Blocks multiplied by an invariant function that must not be negative."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from formulations.bounds.so3_moments.blocks.block_family import BlockFamily
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats


@dataclass(frozen=True, eq=False)
class ScaledBlocks:
    """A scalar localiser: g(x)B(x) ⪰ 0 where g(x) ≥ 0.

    Parameters
    ----------
    family
        The blocks B.
    factor
        Values of g at rotations (configurations, n, 3, 3).
    """

    family: BlockFamily
    factor: Callable[[Floats], Floats]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return self.family.sizes

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        factor = self.factor(rotations)[:, None, None]
        return [factor * block for block in self.family.evaluate(rotations)]
