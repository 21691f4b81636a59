"""What the bounds ask of a family of blocks, whatever its rows are."""

from __future__ import annotations

from typing import Protocol

from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats


class BlockFamily(Protocol):
    """Matrices of functions of a configuration, averaged over all symmetries."""

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
