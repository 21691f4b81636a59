"""What a solver that takes part in the benchmark must offer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from formulations.joints.arm import Arm
from nlp.arrays import FloatArray

# From starts, shape (K, size of the arm), to Jacobians, shape (K, m, n).
Run: TypeAlias = Callable[[FloatArray], FloatArray]


class NotRunError(Exception):
    """A peer that cannot be run here; its message says why in a few words."""


@dataclass(frozen=True)
class Peer:
    """A way to solve one statement on unit revolute joints.

    Attributes
    ----------
    name
        As the table shows it.
    formulation
        What it solves: ``residual`` or ``max-min``.
    prepare
        ``prepare(arm, batch)`` sets up for an arm and batches of that many starts; its time
        is reported separately. Raises NotRunError, or ImportError where a package is missing.
    settings
        How it is set up, in words.
    batched
        Whether it only takes batches of the size it was set up for.
    """

    name: str
    formulation: str
    prepare: Callable[[Arm, int], Run]
    settings: str = ""
    batched: bool = False


def each(one: Callable[[FloatArray], FloatArray], shape: tuple[int, int]) -> Run:
    """Return a function that runs starts one after another."""

    def run(starts: FloatArray) -> FloatArray:
        return np.array([one(start) for start in starts]).reshape(-1, *shape)

    return run
