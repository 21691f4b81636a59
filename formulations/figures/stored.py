"""Starts of a campaign's store, as the figure `optima` counts them."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from formulations.campaign.columns import SCHEMA
from formulations.campaign.frame import frame
from formulations.campaign.groups import SETTINGS
from nlp.errors import FileError
from nlp.solution import SUCCESS
from nlp.store import Store

# Of a line beside a histogram.
_LONGEST = 42
_ALWAYS = ("formulation", "model", "joints")
_NEEDED = ("start", "status", "valid", "worst_case_sigma", "isotropy_defect")


def stored(path: Path) -> pd.DataFrame:
    """Return one row per start of a store, named by the settings that differ within a problem.

    Raises
    ------
    FileError
        If it is no store of a campaign, or holds no records yet.
    """
    with Store(path, SCHEMA) as store:
        records = frame(store, columns=[*SETTINGS, *_NEEDED])
    if records.empty:
        raise FileError("--store", str(path), "a store with records")
    alike = records.groupby(list(_ALWAYS), dropna=False)
    differing = [n for n in SETTINGS if n not in _ALWAYS and alike[n].nunique().max() > 1]
    names = [_name(row, differing) for _, row in records[list(SETTINGS)].iterrows()]
    return pd.DataFrame(
        {
            "problem": [" ".join(name.split()) for name in names],
            "label": names,
            "start": records["start"],
            "status": records["status"],
            "counted": (records["status"] == SUCCESS) & (records["valid"] == 1),
            "worst_case_sigma": records["worst_case_sigma"].astype(float),
            "isotropy_defect": records["isotropy_defect"].astype(float),
        }
    )


def _name(row: pd.Series, differing: list[str]) -> str:
    first = f"{row['formulation']}, {row['joints']} × {row['model']}"
    rest = [f"{name.replace('_', ' ')} {row[name]}" for name in differing if row[name]]
    lines = [one if len(one) <= _LONGEST else f"{one[: _LONGEST - 1]}…" for one in rest]
    return "\n".join([first, *lines])
