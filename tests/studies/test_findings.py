"""Paragraphs made from tables: nothing from nothing, and what they name is in the rows."""

from dataclasses import replace
from pathlib import Path

import pytest

from formulations.files.rows import read_rows
from formulations.reproduction.row import Row as ReproductionRow
from formulations.reproduction.row import Verdict
from formulations.studies import figures as figures_study
from formulations.studies import reproduction_finding as reproduction
from formulations.studies.benchmark import finding as benchmark
from formulations.studies.benchmark.measurement import Row as BenchmarkRow
from formulations.studies.bounds import finding as bounds_finding
from formulations.studies.comparison import finding as comparison
from formulations.studies.comparison.row import Row as ComparisonRow
from formulations.studies.failures import finding as failures
from formulations.studies.failures.row import Row as FailureRow
from formulations.studies.robots import finding as survey_finding
from formulations.studies.robots.survey import SurveyRow

RESULTS = Path(__file__).parents[2] / "results"
NAN = float("nan")


@pytest.mark.parametrize(
    "finding",
    [
        benchmark.finding,
        comparison.finding,
        failures.finding,
        reproduction.finding,
        survey_finding.finding,
        figures_study.finding,
        lambda rows: bounds_finding.finding(rows, rows),
    ],
)
def test_nothing_from_nothing(finding):
    assert finding([]) == ""


def timed(peer, milliseconds):
    seconds = milliseconds / 1e3
    return BenchmarkRow("residual", 7, peer, "", 10, 10, 10, 10, seconds, seconds, 1.0, 0.0, "")


def test_the_benchmark_names_the_quickest_of_either_side():
    rows = [timed("lockedjoint, a", 3.0), timed("lockedjoint, b", 2.0), timed("floor", 0.1)]
    rows += [timed("scipy", 5.0), timed("jax", 4.0), timed("none", NAN)]
    said = benchmark.finding(rows)
    assert "lockedjoint, b takes 2;" in said
    assert "jax takes 4 and scipy 5." in said
    assert "floor" not in said
    assert "none" not in said
    assert benchmark.finding(rows[2:]) == ""


def test_an_unexplained_mismatch_is_named():
    rows = [ReproductionRow("(6)", "bound", "1", "1", Verdict.AGREES)]
    rows.append(ReproductionRow("(46)", "worst case", "1", "2", Verdict.MISMATCH))
    said = reproduction.finding(rows)
    assert said.startswith("Of 2 numbers and claims of the paper, 1 agree; 1 are unexplained")
    assert "(46)" in said
    assert "(6)" not in said


def test_a_bound_is_attained_only_where_no_gap_is_left():
    rows = read_rows(RESULTS / "failures" / "failures.csv", FailureRow)
    assert "the proved bound is attained by free-mean 3×6, 2 locked" in failures.finding(rows)
    assert "joints 0, 1, 2 never failing reaches its bound" in failures.finding(rows)
    wider = [replace(row, gap_percent=row.gap_percent + 1) for row in rows]
    assert "attained" not in failures.finding(wider)
    assert "reaches" not in failures.finding(wider)
    unknown = [replace(row, gap_percent=NAN, merit=NAN) for row in rows]
    assert failures.finding(unknown) == ""


def test_the_best_and_the_poorest_arm_are_named():
    rows = read_rows(RESULTS / "robots" / "robots.csv", SurveyRow)
    seven = [row for row in rows if (row.joints, row.task_dimension) == (7, 6)]
    ranked = sorted(seven, key=lambda row: row.percent_of_best_7r)
    said = survey_finding.finding(rows)
    assert f"{ranked[-1].arm} comes nearest" in said
    assert f"{ranked[0].arm} keeps the least" in said


def test_the_dearest_variant_is_named_and_failed_ones_cost_nothing():
    rows = read_rows(RESULTS / "comparison" / "comparison.csv", ComparisonRow)
    assert "one factor per failure costs the most" in comparison.finding(rows)
    free = [replace(row, seconds_per_success=NAN) if row.variant else row for row in rows]
    assert "costs the most" not in comparison.finding(free)
    assert "proved infeasible" in comparison.finding(rows)
