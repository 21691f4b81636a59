"""Paragraphs made from tables: nothing from nothing, and what they name is in the rows."""

from dataclasses import replace
from pathlib import Path

import pytest

from formulations.reproduction.row import ReproductionRow, Verdict
from formulations.studies.benchmark.measurement import BenchmarkRow
from formulations.studies.running import STUDIES

RESULTS = Path(__file__).parents[2] / "results"
NAN = float("nan")


def finding(name, rows):
    """What a study's template says of rows of its main table."""
    others = {stem: [] for stem in STUDIES[name].tables}
    return STUDIES[name].finding({**others, name: rows})


def committed(name):
    return STUDIES[name].read(RESULTS / name)[name]


@pytest.mark.parametrize("study", STUDIES.values(), ids=lambda study: study.name)
def test_nothing_from_nothing(study):
    assert study.finding({stem: [] for stem in study.tables}) == ""
    assert study.finding(study.read(RESULTS / study.name)) != ""


def timed(peer, milliseconds):
    seconds = milliseconds / 1e3
    times = (seconds, seconds, 1.0, seconds, seconds, seconds)
    return BenchmarkRow("residual", 7, peer, "", 10, 10, 10, 10, *times, 0.0, "")


def test_the_benchmark_names_the_quickest_of_either_side():
    rows = [timed("lockedjoint, a", 3.0), timed("lockedjoint, b", 2.0), timed("floor", 0.1)]
    rows += [timed("scipy", 5.0), timed("jax", 4.0), timed("none", NAN)]
    said = finding("benchmark", rows)
    assert "lockedjoint, b takes 2;" in said
    assert "jax takes 4 and scipy 5." in said
    assert "floor" not in said
    assert "none" not in said
    assert finding("benchmark", rows[2:]) == ""


def test_an_unexplained_mismatch_is_named():
    rows = [ReproductionRow("(6)", "bound", "1", "1", Verdict.AGREES)]
    rows.append(ReproductionRow("(46)", "worst case", "1", "2", Verdict.MISMATCH))
    said = finding("reproduction", rows)
    assert said.startswith("Of 2 numbers and claims of the paper, 1 agree; 1 are unexplained")
    assert "(46)" in said
    assert "(6)" not in said


def test_a_bound_is_attained_only_where_no_gap_is_left():
    rows = committed("failures")
    said = finding("failures", rows).partition(". ")[0]
    assert "the proved bound is attained by" in said
    assert "free-mean 3×6 with 2 locked" in said
    assert "joints 0, 1, 2 never failing reaches its bound" in finding("failures", rows)
    wider = [replace(row, gap_percent=row.gap_percent + 1) for row in rows]
    assert "attained" not in finding("failures", wider)
    assert "reaches" not in finding("failures", wider)
    unknown = [replace(row, gap_percent=NAN, score=NAN) for row in rows]
    assert finding("failures", unknown) == ""


def test_the_best_and_the_poorest_arm_are_named():
    rows = committed("robots")
    seven = [row for row in rows if (row.joints, row.task_dimension) == (7, 6)]
    (structural,) = [row for row in seven if row.structural]
    seven.remove(structural)
    ranked = sorted(seven, key=lambda row: row.percent_of_best_7r)
    said = finding("robots", rows)
    assert f"{ranked[-1].arm} comes nearest" in said
    assert f"{ranked[0].arm} keeps the least" in said
    assert f"{structural.arm} loses full rank whatever the posture" in said
    assert "Near-structural for KUKA LBR iiwa 14: joint_a4." in said
    assert "Near-structural for ABB IRB 140, position alone: joint_1" in said


def test_the_most_expensive_variant_is_named_and_failed_ones_have_no_cost():
    rows = committed("comparison")
    assert "one factor per failure costs the most" in finding("comparison", rows)
    free = [replace(row, relative_cost=NAN) if row.variant else row for row in rows]
    assert "costs the most" not in finding("comparison", free)
    assert "proved infeasible" in finding("comparison", rows)
