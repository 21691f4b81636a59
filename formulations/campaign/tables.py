"""The tables of a campaign's store: its records, groups of them, and the optima they ended at.

A record is what one start came to (`campaign.records` says its columns); a table of records has
beside them the settings of its case. A *problem* is what is optimised, the settings of
`_PROBLEM`; the other settings say how. The *cost* of a record is its score, with the sign
changed where the formulation maximises: small is good. Tables are DataFrames of pandas.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lockedjoint.formulations import measures, registry
from lockedjoint.formulations.campaign import records as stored
from lockedjoint.formulations.campaign.records import ALWAYS, COLUMNS, open_store
from lockedjoint.formulations.campaign.store import Store
from lockedjoint.formulations.io.objects import library
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute
from lockedjoint.formulations.measures.canonical import Symmetry, canonical_form, classes
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.nlp.errors import InputError, one_of, shown
from lockedjoint.nlp.problem import ACCEPTABLE, FEASIBLE, SUCCESS

if TYPE_CHECKING:
    import pandas as pd

# The settings that say what is optimised; the others say how.
_PROBLEM = ("formulation", "model", "joints", "task_dimension", "failures")
# The last settings of a table.
_HOW = ("solver", "options", "seed")
#: The settings that every table of records has, in order.
SETTINGS = ("formulation", "model", "joints", "task_dimension", *ALWAYS, *_HOW)
#: Largest number of optima of a level that are listed: those that come in families are one for
#: each start.
LISTED = 10
# Largest number of levels that are listed, the best ones: there are as many as starts if these
# end anywhere.
_LEVELS = 100


def read_campaign(
    store: Store | str | Path,
    table: str = "groups",
    where: str = "",
    by: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
) -> pd.DataFrame:
    r"""Read a table of the store of a campaign.

    Parameters
    ----------
    store
        The file, or a store that is open.
    table
        ``"groups"``: a row for each group of records, see `grouped`. ``"records"``: a row for
        each record, see `frame`. ``"optima"``: a row for each distinct optimum, see `optima`.
    where
        A condition of ``pandas.DataFrame.query`` on the records; empty for all.
    by
        The settings that make groups; by default all that differ.
    columns
        The columns of the result; by default all.

    Raises
    ------
    StoreError
        If the file is no store, or a record is damaged.
    MissingLibraryError
        If pandas is not installed.
    InputError
        If an argument is not allowed.

    Examples
    --------
    >>> import subprocess, sys
    >>> from pathlib import Path
    >>> import lockedjoint as lj
    >>> lines = 'starts = 2', 'formulations = ["residual"]', 'models = ["unit-revolute"]'
    >>> _ = Path("study.toml").write_text("\n".join([*lines, "joints = [8]"]))
    >>> command = [sys.executable, "-m", "lockedjoint", "campaign", "study.toml", "study.db"]
    >>> _ = subprocess.run(command, check=True, capture_output=True)
    >>> lj.read_campaign("study.db", columns=["joints", "solved"]).to_dict("records")
    [{'joints': 8, 'solved': 2}]
    """
    if not isinstance(store, Store):
        with open_store(store) as opened:
            return read_campaign(opened, table, where, by, columns)
    one_of("table", table, ("groups", "records", "optima"))
    for argument, names in (("by", by), ("columns", columns)):
        if isinstance(names, str):
            raise InputError(argument, names, "a list of names")
    if table == "groups":
        made = grouped(store, where, by)
    else:
        made = frame(store, where) if table == "records" else optima(store, where)
    for name in columns or ():
        one_of("column", name, list(map(str, made)))
    return made[list(columns)] if columns else made


def frame(store: Store, where: str = "", columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Return the records that meet a condition, one row each, with their settings.

    The condition is one of ``pandas.DataFrame.query``; InputError if it is none on these
    columns, MissingLibraryError without pandas. Jacobians are JSON text with every digit.
    """
    library("pandas")
    import pandas as pd

    names = [*COLUMNS, "environment"] if columns is None else list(columns)
    needed = {*re.findall(r"\w+", where)} & {*COLUMNS, "environment"}
    records = store.frame([*names, *(needed - set(names))])
    cells = {cell: stored.settings_of(cell) for cell in records["cell"].unique()}
    # Those of a user's formulations come before the last ones.
    others = {name: None for cell in cells.values() for name in cell if name not in SETTINGS}
    known = [*SETTINGS[: -len(_HOW)], *others, *_HOW]
    settings = pd.DataFrame(cells.values(), index=list(cells), columns=known)
    table = settings.loc[records["cell"]].reset_index(drop=True)
    table = pd.concat([table, records.drop(columns="cell")], axis=1)
    if where:
        table = _chosen(table, where)
    if "jacobian" in names:
        shapes = zip(table["jacobian"], table["task_dimension"], table["joints"], strict=True)
        table["jacobian"] = [json.dumps(stored.jacobian_of(*one).tolist()) for one in shapes]
    return table.drop(columns=list(needed - set(names))).reset_index(drop=True)


def _chosen(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """Return the rows that meet a condition of pandas; InputError if it is none."""
    allowed = "a comparison of columns, such as 'joints == 7'"
    try:
        rows: Any = table.eval(where)
    except Exception as reason:  # pandas raises many kinds
        raise InputError("condition", where, f"{allowed} ({shown(str(reason))})") from None
    if str(getattr(rows, "dtype", "")) != "bool":
        raise InputError("condition", where, allowed)
    chosen: pd.DataFrame = table[rows]
    return chosen


def grouped(store: Store, where: str = "", by: Sequence[str] | None = None) -> pd.DataFrame:
    """Return one row per group of records that meet a condition; see `frame`.

    Groups are by the values of settings: by default those that name the problem, and all
    others that differ within a problem; InputError for anything else. ``reached_best`` counts
    starts within `REACHED_BEST` of the best that any record chosen has for the same problem;
    such a start is a success. Score, worst case and defect are those of the group's best, if
    it is of one problem; with the proved bound on the score, and the gap to that in percent.
    """
    measured = ("status", "iterations", "violation", "valid", "cpu_seconds", *_BEST)
    records = frame(store, where, measured)
    settings = [str(name) for name in records if name not in (*measured, "start")]
    for name in by or ():
        if name not in settings:
            raise InputError("group", name, "one of " + ", ".join(settings))
    if len(set(by or ())) != len(by or ()):
        raise InputError("groups", ",".join(by or ()), "every setting once")
    named = _PROBLEM[:4]
    keys = list(by or (*named, *differing(records, settings, named, _PROBLEM)))
    records["cost"] = _cost(records)
    problem = records.groupby(list(_PROBLEM), sort=False)
    records["problem"] = problem.ngroup()
    reached = records["cost"] - problem["cost"].transform("min") <= REACHED_BEST
    records = records.assign(reached=reached, solved=records["status"] == SUCCESS)
    rows = [_row(keys, group) for _, group in records.groupby(keys, sort=False, dropna=False)]
    return _table(rows, [*keys, *_COLUMNS])


def _table(rows: Sequence[Mapping[str, object]], columns: Sequence[str]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(rows, columns=list(columns))


# Columns of a group's best record.
_BEST = ("score", "worst_case_sigma", "isotropy_defect")
# Columns of the proved bound.
_LIMITS = ("bound", "gap_percent")
# Columns of a table of groups, behind those of the settings.
_COLUMNS = (
    "starts",
    "solved",
    "valid",
    "reached_best",
    *_BEST,
    *_LIMITS,
    "iterations_median",
    "cpu_seconds_per_start",
    "cpu_seconds_per_success",
)


def _row(keys: Sequence[str], group: pd.DataFrame) -> dict[str, object]:
    """Return the row of a group of records: the settings `keys`, and `_COLUMNS`."""
    ranked = group.dropna(subset="cost").sort_values("cost", kind="stable")
    known = len(ranked) > 0 and group["problem"].nunique() == 1
    reached, seconds = int(group["reached"].sum()), float(group["cpu_seconds"].sum())
    return {
        **{name: group[name].iloc[0] for name in keys},
        "starts": len(group),
        "solved": int(group["solved"].sum()),
        "valid": int(group["valid"].sum()),
        "reached_best": reached,
        **{name: ranked[name].iloc[0] if known else np.nan for name in _BEST},
        **_limits(ranked.iloc[0] if known else None),
        "iterations_median": float(group["iterations"].median()),
        "cpu_seconds_per_start": seconds / len(group),
        "cpu_seconds_per_success": seconds / reached if reached else np.nan,
    }


def _limits(best: pd.Series[Any] | None) -> dict[str, float]:
    """Return the proved bound on the score of a problem, and how far its best is from it."""
    if best is not None:
        name, model, joints, task_dimension, failures = (best[name] for name in _PROBLEM)
        arm = models.arm(model, int(joints), int(task_dimension))
        if limit := registry.formulation_of(name).bound(arm, int(failures)):
            return {"bound": limit.value, "gap_percent": limit.gap_percent(best["score"])}
    return dict.fromkeys(_LIMITS, np.nan)


def _cost(records: pd.DataFrame) -> pd.Series[float]:
    """Return what is to be small; NaN for records that do not pass the gate of `Record`."""
    names = records["formulation"].unique()
    minimised = {name: registry.formulation_of(name).SENSE == "minimise" for name in names}
    sign = np.where(records["formulation"].map(minimised).astype(bool), 1.0, -1.0)
    return (records["score"].astype(float) * sign).where(trusted(records))


def trusted(records: pd.DataFrame) -> pd.Series[bool]:
    """Whether each record passes the gate, `Record.trusted`, from the store's own columns."""
    passed: pd.Series[bool] = records["status"].isin((SUCCESS, ACCEPTABLE))
    return passed & (records["valid"] == 1) & (records["violation"] <= FEASIBLE)


def differing(
    records: pd.DataFrame,
    settings: Sequence[str],
    always: Sequence[str],
    problem: Sequence[str],
) -> list[str]:
    """Return the settings, besides `always`, that have several values in one problem.

    Whether one of the settings that name a problem differs is seen where the others are equal.
    """
    cells = records[list(settings)].drop_duplicates()
    return [
        name
        for name in settings
        if name not in always
        and (cells.groupby([n for n in problem if n != name])[name].nunique() > 1).any()
    ]


def optima(store: Store, where: str = "") -> pd.DataFrame:
    """Return one row per optimum, best level first within each problem.

    Optima are classes of Jacobians modulo frame, phase, order and signs, of answers that the
    solver calls solved and that pass the check. Scores belong to one level if each is within
    `REACHED_BEST` of the next. ``classes`` says how many optima a level has, of which the
    `LISTED` most reached are listed, and no more than
    `lockedjoint.formulations.measures.canonical.MOST` are distinguished; ``reached`` counts the
    starts that ended at one, ``of_starts`` at any. Only the 100 best levels are listed.
    """
    columns = ("status", "violation", "valid", "score", "jacobian")
    records = frame(store, where, columns)
    records["cost"] = _cost(records).where(records["status"] == SUCCESS)
    records = records.dropna(subset="cost")
    rows = [
        {**{name: group[name].iloc[0] for name in _PROBLEM}, **row}
        for _, group in records.groupby(list(_PROBLEM), sort=False)
        for row in _optima(group.sort_values("cost", kind="stable"))
    ]
    found = ("level", "score", "worst_case_sigma", "classes", "reached", "of_starts")
    return _table(rows, [*_PROBLEM, *found, "canonical_form"])


def _optima(group: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Yield the optima of a problem's records, which are sorted by cost, level after level."""
    _, model, joints, task_dimension, failures = (group[name].iloc[0] for name in _PROBLEM)
    symmetry = _symmetry(models.arm(model, int(joints), int(task_dimension)))
    levels = (group["cost"].diff() > REACHED_BEST).cumsum() + 1
    for level, members in group[levels <= _LEVELS].groupby(levels):
        jacobians = [np.array(json.loads(text)) for text in members["jacobian"]]
        found = sorted(classes(jacobians, symmetry), key=len, reverse=True)
        for positions in found[:LISTED]:
            first = jacobians[positions[0]]
            yield {
                "level": level,
                "score": members["score"].iloc[positions[0]],
                "worst_case_sigma": measures.worst_case_sigma(first, int(failures)),
                "classes": len(found),
                "reached": len(positions),
                "of_starts": len(group),
                "canonical_form": json.dumps(canonical_form(first, symmetry).tolist()),
            }


def _symmetry(built: Arm) -> Symmetry:
    """Return what leaves every Jacobian of an arm the same."""
    kinds = {type(joint) for joint in built.joints}
    if kinds == {UnitRevolute}:
        return Symmetry.UNIT_REVOLUTE
    if kinds <= {UnitRevolute, LeverRevolute, Prismatic}:
        return Symmetry.REVOLUTE
    return Symmetry.FRAME
