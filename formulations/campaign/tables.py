"""The tables of a study: its records, groups of them, and the optima they ended at.

Groups and levels are computed in SQL by the store, which sorts on the disk: memory does not
grow with the number of records.
"""

import json
from collections.abc import Iterator, Sequence
from itertools import groupby, islice
from operator import itemgetter

import pandas as pd

from formulations import measures
from formulations.campaign.records import SCHEMA, jacobian_of
from formulations.catalogue import FORMULATIONS, arm, formulation
from formulations.joints.arm import Arm
from formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute
from formulations.measures.canonical import canonical_form
from formulations.measures.symmetry import Classes, Symmetry
from formulations.solving.outcome import REACHED_BEST
from nlp.errors import InputError
from nlp.solution import ACCEPTABLE, FEASIBLE, SUCCESS
from nlp.store import Row, Store
from nlp.store_schema import Condition

SETTINGS = tuple(SCHEMA.settings)
# The settings that say what is optimised; the others say how.
PROBLEM = ("formulation", "model", "joints", "task_dimension", "locked")
_ALWAYS = PROBLEM[:4]
# Records that are read at once.
BATCH = 20_000
# Where optima come in families, every start has its own: only so many of a level are listed.
LISTED = 10
# Where starts end anywhere, every one has its own level: only the best are listed.
LEVELS = 100
_FOUND = ("level", "merit", "worst_case_sigma", "classes", "reached", "of_starts")

# The gate of `Record.trusted`: only what passes it reaches the best, or is it.
_TRUSTED = f"status IN ('{SUCCESS}', '{ACCEPTABLE}') AND valid AND violation <= {FEASIBLE!r}"
_PROBLEM = ", ".join(PROBLEM)
_REACHED = "count(*) FILTER (WHERE reached)"
_BEST = "CASE WHEN min(problem) = max(problem) THEN max({}) FILTER (WHERE best) END"
_MIDDLE = "position IN ((size + 1) / 2, (size + 2) / 2)"
# What a group came to: columns, and how they are computed from its records.
_MEASURED = {
    "starts": "count(*)",
    "solved": f"count(*) FILTER (WHERE status = '{SUCCESS}')",
    "valid": "sum(valid)",
    "reached_best": _REACHED,
    "merit": _BEST.format("merit"),
    "worst_case_sigma": _BEST.format("worst_case_sigma"),
    "isotropy_defect": _BEST.format("isotropy_defect"),
    "iterations_median": f"avg(iterations) FILTER (WHERE {_MIDDLE})",
    "cpu_seconds_per_start": "sum(cpu_seconds) / count(*)",
    "cpu_seconds_per_success": f"sum(cpu_seconds) / nullif({_REACHED}, 0)",
}
# Problems and groups are numbered, so that what is sorted is narrow.
_GROUPS = f"""
SELECT min(cell) AS cell, {", ".join(f"{how} AS {name}" for name, how in _MEASURED.items())}
FROM (
    SELECT *, cost - min(cost) OVER (PARTITION BY problem) <= ? AS reached,
        cost NOTNULL AND 1 = row_number()
            OVER (PARTITION BY same ORDER BY cost NULLS LAST, cell, start) AS best,
        row_number() OVER (PARTITION BY same ORDER BY iterations) AS position,
        count(*) OVER (PARTITION BY same) AS size
    FROM (
        SELECT chosen.cell, start, problem, same, status, iterations, valid, cpu_seconds,
            merit, worst_case_sigma, isotropy_defect,
            CASE WHEN {_TRUSTED} THEN
                CASE WHEN formulation IN ({{minimised}}) THEN merit ELSE -merit END
            END AS cost
        FROM chosen JOIN (
            SELECT cell, dense_rank() OVER (ORDER BY {_PROBLEM}) AS problem,
                dense_rank() OVER (ORDER BY {{by}}) AS same
            FROM (SELECT DISTINCT cell, {", ".join(SETTINGS)} FROM chosen)
        ) AS numbered ON numbered.cell = chosen.cell))
GROUP BY same ORDER BY min(cell)"""
# A record whose merit is not near the one before it begins a level.
_LEVELS = """
SELECT jacobian, merit, level, of_starts FROM (
    SELECT *, sum(begins) OVER best_first AS level, count(*) OVER () AS of_starts FROM (
        SELECT *, coalesce(cost - lag(cost) OVER best_first > ?, 1) AS begins
        FROM (SELECT cell, start, jacobian, merit, ? * merit AS cost FROM chosen)
        WINDOW best_first AS (ORDER BY cost, cell, start))
    WINDOW best_first AS (ORDER BY cost, cell, start))
WHERE level <= ? ORDER BY cost, cell, start"""


def frame(
    store: Store, conditions: Sequence[Condition] = (), columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return the records that meet all conditions, one row each.

    Jacobians are JSON text with every digit.
    """
    names = list(SCHEMA.columns if columns is None else columns)
    rows = store.rows(conditions, names)
    parts = []
    while batch := list(islice(rows, BATCH)):  # a frame takes less memory than its rows
        for row in batch if "jacobian" in names else ():
            shape = row["task_dimension"], row["joints"]
            row["jacobian"] = json.dumps(jacobian_of(row["jacobian"], *shape).tolist())
        parts.append(pd.DataFrame(batch, columns=names))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=names)


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
        Settings whose values make the groups, at least one; by default those that name the
        problem, and all others that differ within a problem.

    Returns
    -------
    DataFrame
        The settings, then: ``starts``; ``solved``, starts at which the solver reported
        success; ``valid``, starts whose Jacobian passes the check; ``reached_best``, starts
        within `REACHED_BEST` of the best that any record chosen has for the same problem;
        ``merit``, ``worst_case_sigma`` and ``isotropy_defect`` of the group's best, if it is
        of one problem; ``iterations_median``; ``cpu_seconds_per_start`` and
        ``cpu_seconds_per_success``, processor time, a success being a start that reached the
        best.

    Raises
    ------
    InputError
        If a group is by something else than a setting.
    """
    for name in by or ():
        if name not in SETTINGS:
            raise InputError("group", name, "one of " + ", ".join(SETTINGS))
    if len(set(by or ())) != len(by or ()):
        raise InputError("groups", ",".join(by or ()), "every setting once")
    select = f"SELECT DISTINCT cell, {', '.join(SETTINGS)} FROM chosen"
    cells = pd.DataFrame(store.query(select, conditions), columns=["cell", *SETTINGS])
    by = by or [*_ALWAYS, *differing(cells, _ALWAYS, PROBLEM)]
    for name in cells["formulation"].unique():
        formulation(name)  # refuses a store of formulations that are not known here
    # All that are known: cells may have been added since the last statement.
    minimised = [name for name, one in FORMULATIONS.items() if one.SENSE == "minimise"]
    select = _GROUPS.format(by=", ".join(by), minimised=", ".join("?" * len(minimised)))
    rows = store.query(select, conditions, [REACHED_BEST, *minimised])
    table = pd.DataFrame(rows, columns=["cell", *_MEASURED])
    return table.merge(cells, on="cell")[[*by, *_MEASURED]]


def differing(cells: pd.DataFrame, always: Sequence[str], problem: Sequence[str]) -> list[str]:
    """Return the settings, besides `always`, that have several values in one problem.

    Parameters
    ----------
    cells
        Records with all settings, or one row per cell.
    always
        Settings that are left out.
    problem
        Settings that name a problem; whether one of them differs is seen where the others
        are equal.
    """
    return [
        name
        for name in SETTINGS
        if name not in always
        and (cells.groupby([n for n in problem if n != name])[name].nunique() > 1).any()
    ]


def optima(store: Store, conditions: Sequence[Condition] = ()) -> pd.DataFrame:
    """Return one row per optimum, best level first within each problem.

    Optima are classes of Jacobians modulo frame, phase, order and signs, of answers that the
    solver calls solved and that pass the check. Merits belong to one level if each is within
    `REACHED_BEST` of the next.

    Returns
    -------
    DataFrame
        What names the problem, then: ``level``, 1 for the best value of the merit, 2 for the
        next, up to `LEVELS`; ``merit``, ``worst_case_sigma``; ``classes``, how many optima
        the level has, of which the `LISTED` most reached are listed, and of which no more
        than `formulations.measures.symmetry.MOST` are distinguished; ``reached``, starts
        that ended at this one; ``of_starts``, starts that ended at any optimum;
        ``canonical_form``, the Jacobian that stands for it, as JSON.
    """
    select = f"SELECT {_PROBLEM} FROM chosen GROUP BY {_PROBLEM} ORDER BY min(cell)"
    rows = (
        {**problem, **found}
        for problem in store.query(select, conditions)
        for found in _optima(store, conditions, problem)
    )
    return pd.DataFrame(rows, columns=[*PROBLEM, *_FOUND, "canonical_form"])


def _optima(store: Store, conditions: Sequence[Condition], problem: Row) -> Iterator[Row]:
    ended = {"status": SUCCESS, "valid": 1, **problem}
    conditions = [*conditions, *(Condition(name, "=", value) for name, value in ended.items())]
    conditions.append(Condition("violation", "<=", FEASIBLE))
    sign = 1 if formulation(problem["formulation"]).SENSE == "minimise" else -1
    rows = store.query(_LEVELS, conditions, [REACHED_BEST, sign, LEVELS])
    m, n = problem["task_dimension"], problem["joints"]
    symmetry = _symmetry(arm(problem["model"], n, m))
    for (level, starts), members in groupby(rows, key=itemgetter("level", "of_starts")):
        classes = Classes(symmetry)
        for row in members:
            classes.add(jacobian_of(row["jacobian"], m, n), row["merit"])
        found = classes.most_reached()
        for one in found[:LISTED]:
            yield {
                "level": level,
                "merit": one.merit,
                "worst_case_sigma": measures.worst_case_sigma(one.jacobian, problem["locked"]),
                "classes": len(found),
                "reached": one.reached,
                "of_starts": starts,
                "canonical_form": json.dumps(canonical_form(one.jacobian, symmetry).tolist()),
            }


def _symmetry(built: Arm) -> Symmetry:
    """Return what leaves every Jacobian of an arm the same."""
    kinds = {type(joint) for joint in built.joints}
    if kinds == {UnitRevolute}:
        return Symmetry.UNIT_REVOLUTE
    if kinds <= {UnitRevolute, LeverRevolute, Prismatic}:
        return Symmetry.REVOLUTE
    return Symmetry.FRAME
