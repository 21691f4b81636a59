"""Random starts of one search of one entry, until a rule holds, and what they came to."""

from dataclasses import dataclass
from functools import cached_property
from time import process_time
from typing import Protocol

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.nlp.arrays import FloatArray
from results.second_search.stopping import different, least_starts, settled, unseen_share


class Search(Protocol):
    """A search that leads from random numbers to a Jacobian."""

    def answer(self, rng: np.random.Generator) -> FloatArray:
        """Return the Jacobian that one start leads to, (m, n)."""


@dataclass(frozen=True)
class Limits:
    """How many starts there are if the rule does not hold before.

    Attributes
    ----------
    least
        Least number of starts.
    seconds
        Processor time after which there is no further start, if there were the least.
    most
        Number of starts, at most; there are fewer if the rule would need more, by the optima
        seen so far. None if there is no such limit.
    """

    least: int
    seconds: float
    most: int | None = None


@dataclass(frozen=True, eq=False)
class Tally:
    """Scores of the starts that had an answer, and the best of these."""

    known: float  # the best value known before
    least: int  # the least number of starts
    starts: int
    scores: tuple[float, ...]
    jacobian: FloatArray | None  # the best, (m, n)
    cpu_seconds: float

    @property
    def answers(self) -> int:
        """Number of starts that had an answer: only these count for the rule."""
        return len(self.scores)

    @property
    def best(self) -> float:
        """The best score; NaN if there is none."""
        return max(self.scores, default=np.nan)

    @cached_property
    def optima(self) -> int:
        """Number of different scores, to 1e-6."""
        return different(self.scores)

    @cached_property
    def reached(self) -> int:
        """Number of answers within 1e-6 of the best known, before or now."""
        highest = max(self.known, *self.scores) if self.scores else self.known
        return sum(score > highest - REACHED_BEST for score in self.scores)

    @property
    def unseen_percent(self) -> float:
        """How often a further answer is expected to have a value not yet seen."""
        return 100 * unseen_share(self.answers, self.optima)

    @property
    def settled(self) -> bool:
        """Whether the rule held."""
        return self.starts >= self.least and settled(self.answers, self.optima, self.reached)


def tally(
    asked: Entry, search: Search, seeds: tuple[int, ...], limits: Limits, known: float
) -> Tally:
    """Start a search again and again until the rule holds, or the limits are reached.

    Start k draws from the random numbers of `seeds` and k. `known` is the best value known.
    """
    scores: list[float] = []
    best: FloatArray | None = None
    starts, begun = 0, process_time()
    while True:
        spent = process_time() - begun
        now = Tally(known, limits.least, starts, tuple(scores), best, spent)
        if now.settled or _over(now, limits):
            return now
        jacobian = _answer(search, np.random.default_rng((*seeds, starts)))
        starts += 1
        if jacobian is None or not asked.holds(jacobian):
            continue
        score = asked.score(jacobian)
        if score > max(scores, default=0.0):
            best = jacobian
        scores.append(score)


def _over(now: Tally, limits: Limits) -> bool:
    """Whether there is no further start, although the rule does not hold."""
    if now.starts >= limits.least and now.cpu_seconds > limits.seconds:
        return True
    most = limits.most
    return most is not None and (now.starts >= most or least_starts(now.optima) > most)


def _answer(search: Search, rng: np.random.Generator) -> FloatArray | None:
    """Return the answer of one start; None if its numbers failed, as where σ is 0."""
    try:
        return search.answer(rng)
    except np.linalg.LinAlgError:
        return None
