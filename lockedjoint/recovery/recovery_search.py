"""How much is tried after a failure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lockedjoint.nlp.errors import a_function

# The first round has so many starts: easy answers come soon.
_FEW_STARTS = 60
# The first round has so many boxes: easy proofs come soon.
_FEW_BOXES = 20_000


@dataclass(frozen=True)
class RecoverySearch:
    """How much `recover` tries, and for how long.

    Parameters
    ----------
    starts
        Starts of inverse kinematics, if fewer do not reach the goal.
    boxes
        Most boxes in a proof that the goal is out of reach.
    time_limit
        Time in seconds after which the search for a way around links ends.
    seed
        Random seed; reproducible across machines.
    progress
        A function that is told what is being done.

    Raises
    ------
    InputError
        If a number is out of range.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.RecoverySearch(starts=200, boxes=10_000).starts
    200
    """

    starts: int = 1000
    boxes: int = 1_000_000
    time_limit: float = 5.0
    seed: int = 0
    progress: Callable[[str], None] = lambda _: None

    def __post_init__(self) -> None:
        from lockedjoint.nlp.arrays import real_number, whole_number

        whole_number("starts", self.starts, 1, 100_000)
        whole_number("boxes", self.boxes, 1, 10_000_000)
        allowed = "a number of seconds above 0, at most 3600"
        real_number("time limit", self.time_limit, allowed, 1e-3, 3600.0)
        whole_number("seed", self.seed, 0)
        a_function("progress", self.progress)

    @property
    def rounds(self) -> list[tuple[int, int]]:
        """Starts and boxes, few and then all: what is easy is known soon."""
        whole = (self.starts, self.boxes)
        few = (min(_FEW_STARTS, self.starts), min(_FEW_BOXES, self.boxes))
        return [few, whole] if self.starts > _FEW_STARTS else [whole]
