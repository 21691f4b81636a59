"""Groups of a study's records, and what each came to.

Records pass by twice, some thousands at a time, so that memory does not grow with them: once
for the best of each problem, once to count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from formulations.campaign.columns import SCHEMA
from formulations.campaign.frame import batches
from formulations.catalogue import formulation
from nlp.errors import InputError
from nlp.solution import SUCCESS
from nlp.store import Store
from nlp.store_schema import Condition

# An answer within this of the best one of its problem, by the independent check, reached it.
REACH = 1e-6
# The settings that say what is optimised; the others say how.
PROBLEM = ("formulation", "model", "joints", "task_dimension", "locked")
SETTINGS = tuple(SCHEMA.settings)
_ALWAYS = ("formulation", "model", "joints", "task_dimension")
_BEST = ("merit", "worst_case_sigma", "isotropy_defect")
_MEASURED = ("status", "iterations", "valid", "cpu_seconds", *_BEST)
_COLUMNS = (
    *("starts", "solved", "valid", "reached_best", *_BEST),
    *("iterations_median", "ms_per_start", "ms_per_success"),
)
_NAN = float("nan")


def sign(name: str) -> float:
    """Return what to multiply a formulation's merit by, so that less is better."""
    return 1.0 if formulation(name).SENSE == "minimise" else -1.0


@dataclass
class _Tally:
    """What a group came to so far."""

    problems: set[tuple[object, ...]] = field(default_factory=set)
    iterations: Counter[int] = field(default_factory=Counter)
    starts: int = 0
    solved: int = 0
    valid: int = 0
    reached: int = 0
    seconds: float = 0.0
    cost: float = np.inf
    best: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(_BEST, _NAN))

    def add(self, problem: tuple[object, ...], part: pd.DataFrame, least: float) -> None:
        """Count records of one problem, whose best cost is `least`."""
        costs = sign(str(problem[0])) * part["merit"].to_numpy(dtype=float)
        self.problems.add(problem)
        self.iterations.update(part["iterations"].tolist())
        self.starts += len(part)
        self.solved += int((part["status"] == SUCCESS).sum())
        self.valid += int(part["valid"].sum())
        self.reached += int(np.sum(costs - least <= REACH))
        self.seconds += float(part["cpu_seconds"].sum())
        if not np.all(np.isnan(costs)):
            place = int(np.nanargmin(costs))
            if costs[place] < self.cost:
                self.cost = float(costs[place])
                self.best = {name: float(part[name].iloc[place]) for name in _BEST}

    def line(self) -> dict[str, object]:
        """Return the group's columns."""
        one = len(self.problems) == 1
        milliseconds = 1e3 * self.seconds
        values = (
            *(self.starts, self.solved, self.valid, self.reached),
            *(self.best[name] if one else _NAN for name in _BEST),
            *(_median(self.iterations), milliseconds / self.starts if self.starts else _NAN),
            milliseconds / self.reached if self.reached else _NAN,
        )
        return dict(zip(_COLUMNS, values, strict=True))


def grouped(
    store: Store, conditions: Sequence[Condition] = (), by: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return one row per group of records.

    Parameters
    ----------
    store
        The study.
    conditions
        What records must meet.
    by
        Settings whose values make the groups; by default what names the problem, and
        whatever else differs.

    Returns
    -------
    DataFrame
        The settings, then: ``starts``; ``solved``, starts at which the solver said so;
        ``valid``, starts whose Jacobian passes the check; ``reached_best``, starts within
        `REACH` of the best that any record chosen has for the same problem; ``merit``,
        ``worst_case_sigma`` and ``isotropy_defect`` of the group's best, if it is of one
        problem; ``iterations_median``; ``ms_per_start`` and ``ms_per_success``, processor
        milliseconds, a success being a start that reached the best.

    Raises
    ------
    InputError
        If a group is by something else than a setting.
    """
    for name in by or ():
        if name not in SETTINGS:
            raise InputError("group", name, "one of " + ", ".join(SETTINGS))
    if by is None:
        cells = pd.DataFrame(store.distinct(SETTINGS, conditions), columns=list(SETTINGS))
        by = [name for name in SETTINGS if name in _ALWAYS or _differs(cells, name)]
    least = _least(store, conditions)
    keys = list(dict.fromkeys((*PROBLEM, *by)))
    tallies: dict[tuple[object, ...], _Tally] = {}
    for batch in batches(store, conditions, [*keys, *_MEASURED]):
        for values, part in batch.groupby(keys, sort=False):
            named = dict(zip(keys, values, strict=True))
            problem = tuple(named[name] for name in PROBLEM)
            tally = tallies.setdefault(tuple(named[name] for name in by), _Tally())
            # A record may have arrived since: what is better than the best is the best.
            tally.add(problem, part, least.get(problem, np.inf))
    lines = [{**dict(zip(by, key, strict=True)), **one.line()} for key, one in tallies.items()]
    return pd.DataFrame(lines, columns=[*by, *_COLUMNS])


def _least(store: Store, conditions: Sequence[Condition]) -> dict[tuple[object, ...], float]:
    """Return the best merit of each problem, as a cost."""
    found: dict[tuple[object, ...], float] = {}
    for batch in batches(store, conditions, [*PROBLEM, "merit"]):
        for problem, part in batch.groupby(list(PROBLEM), sort=False):
            cost = float((sign(str(problem[0])) * part["merit"].astype(float)).min())
            found[problem] = float(np.fmin(found.get(problem, np.inf), cost))
    return found


def _differs(cells: pd.DataFrame, name: str) -> bool:
    """Whether a setting has several values in one problem."""
    if cells.empty:
        return False
    apart = [other for other in PROBLEM if other != name]
    return bool((cells.groupby(apart)[name].nunique() > 1).any())


def _median(counts: Counter[int]) -> float:
    values = np.array(sorted(counts))
    if not values.size:
        return _NAN
    ends = np.cumsum([counts[value] for value in values.tolist()])
    low, high = np.searchsorted(ends, [(ends[-1] - 1) // 2, ends[-1] // 2], side="right")
    return float(values[low] + values[high]) / 2
