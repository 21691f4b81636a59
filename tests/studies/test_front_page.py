"""The front page: it says what the tables show, and nothing where a table is missing."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.io.table import read_rows
from formulations.studies.comparison import ComparisonRow
from formulations.studies.existence import Fact
from formulations.studies.front_page import (
    formulation_table,
    front_page,
    learned,
    plain,
    read_all,
)
from formulations.studies.pages import outward, rounded_down, rounded_up
from formulations.studies.running import STUDIES
from nlp.errors import FileError

RESULTS = Path(__file__).parents[2] / "results"


@pytest.fixture(scope="module")
def tables():
    return read_all(RESULTS)


def item(tables, words):
    return [text for text in learned(tables).splitlines() if words in text]


def test_nothing_is_said_without_tables(tmp_path):
    assert learned(read_all(tmp_path)) == ""
    page = front_page(tmp_path, 3, set(), {})
    assert "- seed: 3" in page
    assert "Nothing yet." in page
    assert page.count("Not there;") == len(STUDIES)
    assert "proved" not in page


def test_nothing_is_called_proved_that_is_not(tables):
    assert item(tables, "No optimally failure-tolerant 7R")
    others = [fact for fact in tables["existence"] if fact.quantity != "verdict"]
    doubtful = (*others, Fact("verdict", "not proved"))
    assert not item({**tables, "existence": doubtful}, "No optimally failure-tolerant")


def test_a_minimum_is_global_only_where_the_bound_meets_it(tables):
    assert item(tables, "It is the global minimum to")
    loose = tuple(row for row in tables["bounds"] if row.preset != "tight")
    text = item({**tables, "bounds": loose}, "The residual minimum")
    assert len(text) == 1
    assert "global" not in text[0]
    assert "Rigorously, nothing is below 0.05665." in text[0]


def test_a_minimum_is_one_jacobian_only_where_one_was_counted(tables):
    two = tuple(replace(row, distinct_optima=2) for row in tables["comparison"])
    assert item(tables, "is *one* Jacobian")
    assert not item({**tables, "comparison": two}, "is *one* Jacobian")


def test_isotropy_and_failure_tolerance_differ_only_where_they_do(tables):
    better = tuple(
        replace(row, worst_case_sigma=0.6) if row.formulation == "isotropy" else row
        for row in tables["comparison"]
    )
    assert item(tables, "are different goals")
    assert not item({**tables, "comparison": better}, "are different goals")


@given(st.floats(1e-3, 10), st.integers(2, 9))
def test_rounded_bounds_are_still_bounds(number, digits):
    unit = 1.000001 * 10.0**-digits
    assert number - unit < float(rounded_down(number, digits)) <= number
    assert number <= float(rounded_up(number, digits)) < number + unit


@pytest.mark.parametrize(
    ("number", "lower", "shown"),
    [
        (0.5371224, False, "0.537123"),
        (0.0568237833, True, "0.0568237"),
        (0.5773502691896258, False, "0.577351"),
        (0.5, False, "0.5"),
        (0.0, True, "0"),
        (12.3456789, True, "12.3456"),
    ],
)
def test_bounds_are_rounded_outward(number, lower, shown):
    assert outward(number, 6, lower=lower) == shown


def test_a_row_that_is_not_there_is_dashes(tables):
    shown = formulation_table({**tables, "comparison": []})
    assert shown.count(" – ") >= 12 * 7
    eight = tuple(row for row in tables["comparison"] if row.joints == 8)
    shown = formulation_table({**tables, "comparison": eight})
    assert all(" – " in line for line in shown.splitlines() if "7R" in line)


def test_a_line_has_the_row_s_numbers(tables):
    row = plain(tables["comparison"], "max-min", "unit-revolute", 7)
    [line] = [
        text
        for text in formulation_table(tables).splitlines()
        if text.startswith("| 7R, unit lever arms | max-min")
    ]
    cells = [cell.strip() for cell in line.strip("|").split("|")][2:]
    value, bound, gap, sigma, defect, success, cost = cells
    assert float(value) == pytest.approx(row.score, abs=1e-6)
    number, _, kind = bound.partition(", ")
    assert float(number) == pytest.approx(row.certified_bound, abs=1e-6)
    assert kind == row.certificate
    assert float(gap) == pytest.approx(row.certified_gap_percent, abs=0.005)
    assert float(sigma) == pytest.approx(row.worst_case_sigma, abs=1e-6)
    assert float(defect) == pytest.approx(row.isotropy_defect, abs=1e-6)
    assert success == f"{row.reached_best} of {row.starts}"
    assert float(cost) == pytest.approx(1e3 * row.cpu_seconds_per_success, rel=0.005)


def test_kept_failed_and_missing_studies_are_distinguished(tmp_path):
    for name in ("robots", "existence"):
        (tmp_path / name).mkdir()
        text = "# Page\n\n- command: lockedjoint\n- date: 2020-02-02\n\n- not: this\n"
        (tmp_path / name / STUDIES[name].page).write_text(text)
    page = front_page(tmp_path, 0, {"existence"}, {"figures": "matplotlib is missing"})
    [robots] = [line for line in page.splitlines() if line.startswith("| [robots]")]
    [existence] = [line for line in page.splitlines() if line.startswith("| [existence]")]
    assert "2020-02-02 (kept)" in robots
    assert "2020-02-02 " in existence
    assert "kept" not in existence
    left = page.partition("## Left out of this run")[2]
    assert "figures: matplotlib is missing (nothing is there)" in left
    assert "robots: takes" in left
    assert "2020-02-02" in left
    assert "- existence" not in left


def test_a_table_of_another_version_is_not_read(tmp_path):
    path = tmp_path / "comparison.csv"
    path.write_text("formulation,variant\nresidual,\n")
    with pytest.raises(FileError, match="columns of this version"):
        read_rows(path, ComparisonRow)
    with pytest.raises(FileError, match="can be read"):
        read_rows(tmp_path / "other.csv", ComparisonRow)


def test_a_cell_that_is_no_number_is_not_read(tmp_path):
    text = (RESULTS / "comparison" / "comparison.csv").read_text(encoding="utf-8")
    good = tmp_path / "good.csv"
    good.write_text(text, encoding="utf-8")
    assert len(read_rows(good, ComparisonRow)) == 9
    bad = tmp_path / "bad.csv"
    bad.write_text(text.replace(",100,", ",many,"), encoding="utf-8")
    with pytest.raises(FileError, match="table"):
        read_rows(bad, ComparisonRow)


def test_pictures_stand_where_they_are_and_only_there(tmp_path):
    page = front_page(RESULTS, 0, set(), {})
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page)
    assert len(shown) == len(set(shown)) >= 6
    assert all((RESULTS / file).exists() for file in shown)
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "optima.svg").write_text("<svg/>")
    alone = front_page(tmp_path, 0, set(), {})
    assert alone.count("](figures/") == alone.count("](figures/optima.svg)") == 1
