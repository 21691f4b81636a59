"""The survey of robots as files and as text."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from formulations.files.provenance import header, versions
from formulations.robots.robot_assessment import best_7r
from formulations.studies.robots.finding import finding
from formulations.studies.robots.survey import Surveyed, SurveyRow
from nlp.files import write_text

_SHOWN = {
    "arm": "arm",
    "task": "task",
    "joints": "joints",
    "worst_case_sigma": "worst-case σ",
    "percent_of_bound": "% of the bound",
    "percent_of_best_7r": "% of the best 7R",
    "mid_range_sigma": "σ at mid-range",
    "characteristic_length": "ℓ (m)",
    "worst_case_joint": "worst failure",
    "equally_bad": "as bad",
    "at_limits": "at a limit",
    "starts": "starts",
    "reached_best": "reached best",
}
_FORMATS = {
    "worst_case_sigma": "{:.5f}",
    "percent_of_bound": "{:.2f}",
    "percent_of_best_7r": "{:.2f}",
    "mid_range_sigma": "{:.5f}",
    "characteristic_length": "{:.3f}",
}
_NOTES = f"""\
Every posture is within the joints' limits, found by max-min and measured again from its
Jacobian alone; collisions of the robot with itself are not looked at. Lengths are measured in
ℓ, the root mean square of the revolute joints' lever arms at that posture, so that σ does not
depend on the robot's size. *The bound* is eq. (6), which no arm of so many joints can pass;
*the best 7R* is the largest worst case that seven revolute joints are known to reach however
they are placed, σ = {best_7r():.6f} at mean square lever arm 1, in six dimensions; an arm
with more joints may pass it. *As bad* counts the joints whose failure leaves the same. The
chain goes from the robot's root to the tip named in robots.csv, torso included where there is
one. Robots have many local optima: where few starts reached the best, a better posture may
remain to be found.
"""


def table(rows: Sequence[SurveyRow]) -> pd.DataFrame:
    """All columns, one line per arm."""
    return pd.DataFrame(
        [one.to_dict() for one in rows], columns=list(SurveyRow.__dataclass_fields__)
    )


def summary(rows: Sequence[SurveyRow]) -> pd.DataFrame:
    """Return the columns to read, as text."""
    frame = table(rows)
    for column, style in _FORMATS.items():
        frame[column] = [
            "–" if pd.isna(value) else style.format(value) for value in frame[column]
        ]
    fatal = [one.fatal_failures for one in rows]
    frame["worst_case_joint"] = [
        f"{names}: fatal at every posture" if names else joint
        for names, joint in zip(fatal, frame["worst_case_joint"], strict=True)
    ]
    frame["at_limits"] = [names or "–" for names in frame["at_limits"]]
    return frame[list(_SHOWN)].rename(columns=_SHOWN)


def markdown(rows: Sequence[SurveyRow], seed: int, complete: bool = True) -> str:
    """Return the survey as a Markdown page: where it came from, notes, table, statuses."""
    robots = versions(list(dict.fromkeys(one.package for one in rows)))
    statuses = "\n".join(f"- {one.arm}, {one.task}: {one.status_counts}" for one in rows)
    postures = "\n".join(_posture(one) for one in rows if not one.fatal_failures)
    note = "" if complete else "\nInterrupted: not all starts or arms are here.\n"
    return (
        f"# Arms that exist\n\n{header({'seed': seed, 'robots': robots})}{note}\n"
        f"{finding(rows)}\n\n{_NOTES}\n"
        f"{summary(rows).to_markdown(index=False, disable_numparse=True)}\n\n"
        f"Postures, in radians and metres (every digit in robots.csv):\n\n{postures}\n\n"
        f"Ipopt's return statuses:\n\n{statuses}\n"
    )


def write(found: Sequence[Surveyed], folder: Path, seed: int, complete: bool) -> None:
    """Write ``robots.csv``, ``robots.md`` and ``postures.json`` into the folder.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    rows = [one.row for one in found]
    postures = [
        {"arm": one.row.arm, "variant": one.row.task, **one.posture.to_dict()}
        for one in found
        if one.posture is not None
    ]
    write_text(folder / "robots.csv", table(rows).to_csv(index=False))
    write_text(folder / "robots.md", markdown(rows, seed, complete))
    write_text(folder / "postures.json", json.dumps(postures, indent=1) + "\n")


def _posture(one: SurveyRow) -> str:
    positions = json.loads(one.configuration)
    shown = ", ".join(f"{joint} {value:z.4f}" for joint, value in positions.items())
    return f"- {one.arm}, {one.task}: {shown}"
