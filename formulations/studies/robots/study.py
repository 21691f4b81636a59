"""The survey of robots that exist as a study."""

from __future__ import annotations

from pathlib import Path

from formulations.files.rows import read_rows
from formulations.robots.posture import Search
from formulations.studies.robots.finding import finding
from formulations.studies.robots.report import write
from formulations.studies.robots.survey import SurveyRow, survey
from formulations.studies.robots.survey_arms import ARMS
from formulations.studies.study import Effort, Study

TABLE = "robots.csv"
STARTS = 200


def study() -> Study:
    """Return the survey."""
    return Study(
        name="robots",
        title="the best postures of arms that exist",
        page="robots.md",
        table=TABLE,
        command="lockedjoint robots --out results/robots",
        takes="up to a quarter of an hour, and packages of robots",
        long=True,
        run=_run,
        finding=lambda folder: finding(read_rows(folder / TABLE, SurveyRow)),
    )


def _run(folder: Path, effort: Effort) -> str:
    for one in ARMS:
        one.arm()  # a missing package is better known now than after minutes
    search = Search(starts=effort.starts_or(STARTS), seed=effort.seed, workers=effort.workers)
    found = []
    for one in ARMS:
        effort.progress(f"{one.name}, {one.task}")
        surveyed = survey(one, search)
        if surveyed.posture is not None and not surveyed.posture.complete:
            raise KeyboardInterrupt
        found.append(surveyed)
    write(found, folder, effort.seed, complete=True)
    return ""
