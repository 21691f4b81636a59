"""What the atlas asks for: the entries, one Jacobian each, and what is known of each.

An `Entry` is a question, an `EntryPage` the answer on record, an `AtlasRow` its line in a
table. J is a Jacobian, shape (m, n): m task dimensions, one column for each of n joints, of
which any k lock at once. Columns have no units: how long they may be is what the model says.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from lockedjoint.formulations import condition, isotropy, manipulability, max_min, registry
from lockedjoint.formulations.atlas.exact_value import ExactValue, exact_value
from lockedjoint.formulations.bounds.certified import Bound
from lockedjoint.formulations.io.rounding import rounded_up
from lockedjoint.formulations.io.table import HIDDEN, column, row_from
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.measures import gap_percent, isotropy_defect, trace
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

#: Improvements, and distances from a bound, that are smaller than this do not count.
RESOLUTION = 1e-9
#: Number of starts that must reach the best before a search ends, and before a value is
#: conjectured to be optimal.
ENOUGH = 20
# Largest ‖JJᵀ − (T/m)I‖_F, relative to T/m, of a Jacobian that has to be isotropic: what it can
# gain by more is less than `RESOLUTION`.
_ISOTROPIC = 1e-10
# A value is conjectured to be optimal if one of so many starts, or more, reached it.
_ONE_START_IN = 5


@dataclass(frozen=True, order=True)
class Entry:
    """One question: the best worst case of a kind of arm, `failures` joints of which lock.

    Attributes
    ----------
    model
        The name of the joints' column model; see `models.arm`.
    task_dimension, joints, failures
        m, n and k.
    formulation
        ``max-min``; ``isotropy`` where only exactly isotropic Jacobians count; or
        ``manipulability`` and ``condition``, whose values are the least relative manipulability
        and the least reciprocal condition number instead of the worst case σ.
    """

    model: str
    task_dimension: int
    joints: int
    failures: int = 1
    formulation: str = max_min.NAME

    @property
    def name(self) -> str:
        """Its name in tables and of its file."""
        model = self.model.replace(":", "-").replace(",", "+")
        mark = "" if self.formulation == max_min.NAME else f"_{self.formulation}"
        return f"{model}_{self.task_dimension}x{self.joints}_k{self.failures}{mark}"

    @property
    def arm(self) -> Arm:
        """The joints."""
        return models.arm(self.model, self.joints, self.task_dimension)

    @property
    def bound(self) -> Bound:
        """The sharpest upper bound on the worst case."""
        return _bound(self)

    @property
    def relative(self) -> bool:
        """Whether its value is the least relative manipulability instead of the worst case."""
        return self.formulation == manipulability.NAME

    def holds(self, jacobian: FloatArray) -> bool:
        """Whether a Jacobian, shape (m, n), is one of those that the entry asks for."""
        if jacobian.shape != (self.task_dimension, self.joints):
            return False
        if not self.arm.admits(jacobian) or not np.isfinite(self.score(jacobian)):
            return False
        scale = trace(jacobian) / self.task_dimension
        largest = 0.5 * (_ISOTROPIC * scale) ** 2
        return self.formulation != isotropy.NAME or isotropy_defect(jacobian) <= largest

    def score(self, jacobian: FloatArray) -> float:
        """Return what is asked for, of a Jacobian, shape (m, n), as the formulation does."""
        stated = registry.formulation_of(self.formulation)
        failures = {"failures": self.failures} if "failures" in stated.SETTINGS else {}
        return float(stated.score(jacobian, **failures))


@cache
def _bound(asked: Entry) -> Bound:
    """Return the bound of an entry: computed once, as it can take seconds."""
    return registry.bound(asked.formulation, asked.arm, asked.failures)


@dataclass(frozen=True)
class Found:
    """How a Jacobian was found, as its finder reports it.

    Attributes
    ----------
    by
        Who found it.
    date
        When, as YYYY-MM-DD.
    statement
        Name and settings of what was solved, such as ``max-min, shared-factor``.
    seeds, starts, reached_best
        Numbers of groups of random starts, of the starts, and of those that ended at the best.
    cpu_seconds
        Processor time of all starts.
    versions, machine
        Versions of the packages, and the machine.
    """

    by: str
    date: str
    statement: str = ""
    seeds: int = 0
    starts: int = 0
    reached_best: int = 0
    cpu_seconds: float = 0.0
    versions: str = ""
    machine: str = ""


@dataclass(frozen=True, eq=False)
class EntryPage:
    """What the atlas has on an entry.

    Attributes
    ----------
    entry
        The question.
    jacobian
        The best one known, in canonical form, shape (m, n).
    value
        Its worst case, or what its formulation asks for, proved from below: a decimal number of
        15 decimals, as text.
    family
        Dimension, to second order, of the Jacobians around it that are as good, apart from
        those that differ by a change of frame or phase only; None where the value is no worst
        case.
    locally_optimal
        Whether it is proved that no change of J, however small, is better by `RESOLUTION`: by
        the library, or by results/atlas/exact.py where its exact value is a sharp maximum.
    found
        How it was found.
    history
        The values before, latest last, each with how it was found: keys ``value`` and
        ``found``, the latter with the fields of `Found`. It is never overwritten.
    """

    entry: Entry
    jacobian: FloatArray
    value: str
    family: int | None
    locally_optimal: bool
    found: Found
    history: tuple[Mapping[str, Any], ...] = field(default=())

    def __repr__(self) -> str:
        """Say in one line which entry it is, its value and its mark."""
        return f"<EntryPage: {self.entry.name}, {self.value} ({self.mark})>"

    @property
    def gap_percent(self) -> float:
        """How far the value is below the bound, in percent of the bound."""
        return gap_percent(float(self.value), self.entry.bound.value)

    @property
    def mark(self) -> str:
        """``optimal`` if a bound proves it, ``conjectured`` if many starts end there, ``open``.

        Many are 20, and a fifth of all that were made, by the numbers that the file reports.
        """
        bound = self.entry.bound
        if bound.certified and bound.value - float(self.value) <= RESOLUTION:
            return "optimal"
        many = self.found.reached_best >= max(ENOUGH, self.found.starts / _ONE_START_IN)
        return "conjectured" if many else "open"

    @property
    def reported(self) -> tuple[str, ...]:
        """Names of the facts that rest on what the file's author writes, and nobody verifies.

        So do those in ``found`` and ``history``; and the mark, if numbers of starts decide it.
        """
        return ("found", "history") if self.mark == "optimal" else ("found", "history", "mark")

    @property
    def exact(self) -> ExactValue | None:
        """Its squared worst case as a root of a polynomial, where that is known; else None."""
        return exact_value(self.entry.name, self.value)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as in the entry's file: the fields of entry and page by name."""
        return {
            "entry": self.entry.name,
            **vars(self.entry),
            "value": self.value,
            "family": self.family,
            "locally_optimal": self.locally_optimal,
            "found": vars(self.found),
            "history": list(self.history),
            "jacobian": self.jacobian.tolist(),
        }

    def facts(self) -> dict[str, Any]:
        """Return plain values of the file, and what follows from them.

        The keys beside those of `to_dict` are ``gap_percent``, ``mark``, ``exact``, ``bound``
        and ``reported``, which names those facts that nobody verifies.
        """
        exact = self.exact.to_dict() if self.exact else None
        follows = {"gap_percent": self.gap_percent, "mark": self.mark, "exact": exact}
        follows["reported"] = list(self.reported)
        return {**self.to_dict(), "bound": self.entry.bound.to_dict(), **follows}

    def to_json(self) -> str:
        """Return the text of the entry's file: one line of J to a line."""
        values = self.to_dict()
        rows = ",\n  ".join(json.dumps(row) for row in values.pop("jacobian"))
        body = json.dumps(values, indent=1)
        return f'{body[:-2]},\n "jacobian": [\n  {rows}\n ]\n}}\n'


@dataclass(frozen=True)
class AtlasRow:
    """One entry, a line of ``atlas.csv``: fields of `Entry`, `EntryPage` and `Found` by name.

    `bound` and `kind` are the number of the sharpest upper bound, and how it is known.
    """

    entry: str = field(metadata=column(brief=True))
    model: str = field(metadata=HIDDEN)
    task_dimension: int = field(metadata=HIDDEN)
    joints: int = field(metadata=HIDDEN)
    failures: int = field(metadata=HIDDEN)
    formulation: str = field(metadata=HIDDEN)
    value: str = field(metadata=column(brief=True))
    bound: float = field(
        metadata=column("bound", lambda row: rounded_up(row.bound, 9), brief=True)
    )
    kind: str = field(metadata=column("known by"))
    gap_percent: float = field(metadata=column("gap %", "z.3f", brief=True))
    mark: str = field(metadata=column(brief=True))
    family: int | None = field(
        metadata=column("family", lambda row: "–" if row.family is None else str(row.family))
    )
    locally_optimal: bool = field(
        metadata=column("local", lambda row: "proved" if row.locally_optimal else "–")
    )
    reached_best: int = field(
        metadata=column("reached", lambda row: f"{row.reached_best}/{row.starts}", brief=True)
    )
    starts: int = field(metadata=HIDDEN)
    cpu_seconds: float = field(metadata=column("CPU (s)", ".0f"))
    by: str = field(metadata=HIDDEN)
    date: str = field(metadata=column())

    @property
    def section(self) -> str:
        """Which table of the page it is in."""
        kinds = "revolute and prismatic" if "prismatic" in self.model else self.model
        return f"{kinds}, m = {self.task_dimension}"


def row_of(page: EntryPage) -> AtlasRow:
    """Return an entry's row."""
    bound = page.entry.bound
    stated = {"entry": page.entry.name, "bound": bound.value, "kind": bound.kind}
    return row_from(AtlasRow, page.entry, page.found, page, **stated)


@lru_cache
def entries() -> Mapping[str, Entry]:
    """Return all entries by name, model after model."""
    return {entry.name: entry for entry in _entries()}


def entry(name: str) -> Entry:
    """Return the entry of a name, or raise InputError."""
    known = entries()
    if name not in known:
        from difflib import get_close_matches

        near = get_close_matches(name, known, 3) or [next(iter(known))]
        raise InputError("entry", name, f"a name that `atlas` lists, such as {', '.join(near)}")
    return known[name]


class _Sizes(NamedTuple):
    """Entries of one formulation and model: numbers of joints, and 1 to most failures."""

    formulation: str
    model: str
    task_dimension: int
    joints: range
    most_failures: int


# Entries of arms whose joints are all of one kind. Free columns of length 1 are sensors, or
# frames of unit vectors; those of `condition` are numerically erasure-robust frames. Lever arms
# with limits of their own are thrusters; rotors here all turn one way.
_OF_ONE_KIND = (
    _Sizes(max_min.NAME, "free-mean", 2, range(3, 13), 4),
    _Sizes(max_min.NAME, "free-mean", 3, range(4, 13), 3),
    _Sizes(max_min.NAME, "free-mean", 6, range(7, 13), 2),
    _Sizes(max_min.NAME, "free", 2, range(3, 13), 3),
    _Sizes(max_min.NAME, "free", 3, range(4, 13), 3),
    _Sizes(max_min.NAME, "unit-revolute", 6, range(7, 17), 3),
    _Sizes(max_min.NAME, "lever-revolute", 6, range(7, 13), 2),
    _Sizes(isotropy.NAME, "lever-revolute", 6, range(7, 8), 1),
    _Sizes(manipulability.NAME, "free-mean", 2, range(3, 9), 3),
    _Sizes(manipulability.NAME, "free-mean", 3, range(4, 9), 2),
    _Sizes(manipulability.NAME, "unit-revolute", 6, range(7, 12), 2),
    _Sizes(condition.NAME, "free-mean", 2, range(3, 11), 3),
    _Sizes(condition.NAME, "free-mean", 3, range(4, 11), 2),
    _Sizes(max_min.NAME, "lever-revolute-each", 6, range(7, 13), 2),
    _Sizes(max_min.NAME, "rotor", 6, range(7, 13), 2),
)


def _entries() -> Iterator[Entry]:
    """Yield all entries; one that is added here has no Jacobian on record yet."""
    for formulation, model, m, joints, most_failures in _OF_ONE_KIND:
        for n in joints:
            for k in range(1, min(most_failures, n - m) + 1):
                yield Entry(model, m, n, k, formulation)
    # Joints of two kinds: revolute and prismatic ones, and rotors that turn both ways.
    for n in range(7, 11):
        for prismatic in (1, 2):
            mix = f"unit-revolute:{n - prismatic},prismatic:{prismatic}"
            yield Entry(mix, 6, n)
            mix = f"lever-revolute:{n - prismatic},prismatic:{prismatic}"
            yield Entry(mix, 6, n, 1, isotropy.NAME)
        mix = f"rotor:{n - n // 2},counter-rotor:{n // 2}"
        for k in range(1, min(2, n - 6) + 1):
            yield Entry(mix, 6, n, k)
    # Frames for erasures: with one erasure every isotropic J of equal norms is optimal.
    for model in ("free-mean", "free"):
        for m, most_failures in ((2, 3), (3, 2)):
            for n in range(m + 2, 13):
                for k in range(2, min(most_failures, n - m) + 1):
                    yield Entry(model, m, n, k, isotropy.NAME)
