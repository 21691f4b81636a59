"""Records of a study as a table, and a grouped table of what they came to."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import numpy as np
import pandas as pd

from formulations.campaign.columns import SCHEMA
from formulations.catalogue import FORMULATIONS
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
_MEASURED = (
    *("status", "iterations", "valid", "merit", "worst_case_sigma", "isotropy_defect"),
    "cpu_seconds",
)
_BATCH = 20_000


def frame(
    store: Store, conditions: Sequence[Condition] = (), columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return the records that meet all conditions, one row each."""
    names = list(SCHEMA.columns if columns is None else columns)
    rows = store.rows(conditions, names)
    parts = [pd.DataFrame(columns=names)]
    while batch := list(islice(rows, _BATCH)):
        parts.append(pd.DataFrame(batch, columns=names))
    return pd.concat(parts[1:], ignore_index=True) if len(parts) > 1 else parts[0]


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
    records = frame(store, conditions, [*SETTINGS, *_MEASURED])
    records["reached"] = _reached(records)
    if by is None:
        by = [name for name in SETTINGS if name in _ALWAYS or _differs(records, name)]
    lines = [
        {**dict(zip(by, values, strict=True)), **_line(group)}
        for values, group in records.groupby(list(by), sort=False)
    ]
    return pd.DataFrame(lines, columns=[*by, *_line(records)])


def _differs(records: pd.DataFrame, name: str) -> bool:
    """Whether a setting has several values in one problem."""
    if records.empty:
        return False
    apart = [other for other in PROBLEM if other != name]
    return bool((records.groupby(apart)[name].nunique() > 1).any())


def _reached(records: pd.DataFrame) -> pd.Series:
    """Whether each record is within `REACH` of the best of its problem."""
    if records.empty:
        return pd.Series(dtype=bool)
    smaller_is_better = _signs(records["formulation"]) * records["merit"].astype(float)
    problems = [records[name] for name in PROBLEM]
    best = smaller_is_better.groupby(problems).transform("min")
    return (smaller_is_better - best) <= REACH


def _signs(formulations: pd.Series) -> pd.Series:
    signs = {n: 1.0 if f.SENSE == "minimise" else -1.0 for n, f in FORMULATIONS.items()}
    return formulations.map(signs).astype(float)


def _line(group: pd.DataFrame) -> dict[str, object]:
    reached, seconds = int(group["reached"].sum()), float(group["cpu_seconds"].sum())
    best = _best(group)
    nan = float("nan")
    return {
        "starts": len(group),
        "solved": int((group["status"] == SUCCESS).sum()),
        "valid": int(group["valid"].sum()),
        "reached_best": reached,
        "merit": nan if best is None else float(best["merit"]),
        "worst_case_sigma": nan if best is None else float(best["worst_case_sigma"]),
        "isotropy_defect": nan if best is None else float(best["isotropy_defect"]),
        "iterations_median": float(np.median(group["iterations"])) if len(group) else nan,
        "ms_per_start": 1e3 * seconds / len(group) if len(group) else nan,
        "ms_per_success": 1e3 * seconds / reached if reached else nan,
    }


def _best(group: pd.DataFrame) -> pd.Series | None:
    one = all(group[name].nunique() == 1 for name in PROBLEM)
    if not one or group["merit"].isna().all():
        return None
    smaller_is_better = _signs(group["formulation"]) * group["merit"].astype(float)
    return group.iloc[int(np.nanargmin(smaller_is_better.to_numpy()))]
