"""How much work a computation of many starts may do, and who is told of it."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """Seed, starts and workers of a computation.

    Attributes
    ----------
    seed
        Seed of all random starts, at least 0.
    starts
        Random starts of each problem; None for as many as the computation usually makes.
    workers
        Number of processes.
    progress
        A function that is told what is being done, in a few words.
    bars
        Whether many starts show a progress bar.
    """

    seed: int = 0
    starts: int | None = None
    workers: int = 1
    progress: Callable[[str], None] = lambda _: None
    bars: bool = False
