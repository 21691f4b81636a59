"""Studies are run one after another; the front page says what the tables show, no more."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from formulations.io import pages
from formulations.reproduction.row import Verdict
from results import regenerate
from results.benchmark.benchmark import BenchmarkRow
from results.existence.existence import Fact
from results.regenerate import STUDIES, TEMPLATE, front_page, main, plain, read_all, values

RESULTS = Path(__file__).parents[2] / "results"


@pytest.fixture(scope="module")
def tables():
    return read_all(RESULTS)


def block(name, tables):
    return pages.block(TEMPLATE, name, values(tables))


def test_nothing_is_said_without_tables(tmp_path):
    assert block("learned", read_all(tmp_path)).strip() == ""
    page = front_page(tmp_path, 3)
    assert "- seed: 3" in page
    assert "Nothing yet." in page
    assert page.count("Not there;") == len(STUDIES)
    assert "proved" not in page


def less_isotropic(row):
    return replace(row, worst_case_sigma=0.6) if row.formulation == "isotropy" else row


@pytest.mark.parametrize(
    ("words", "table", "change"),
    [
        ("No optimally failure-tolerant 7R", "existence", lambda row: replace(row, value="no")),
        ("the global minimum to", "bounds", lambda row: None if row.preset == "tight" else row),
        ("is *one* Jacobian", "comparison", lambda row: replace(row, distinct_optima=2)),
        ("are different goals", "comparison", less_isotropic),
    ],
)
def test_what_was_learned_is_said_only_where_the_tables_show_it(tables, words, table, change):
    assert words in block("learned", tables)
    changed = [row for row in map(change, tables[table]) if row is not None]
    assert words not in block("learned", {**tables, table: changed})


def test_a_line_has_the_row_s_numbers_or_dashes(tables):
    row = plain(tables["comparison"], "max-min", "unit-revolute", 7)
    lines = block("formulations", tables).splitlines()
    [line] = [text for text in lines if text.startswith("7R, unit lever arms | max-min")]
    _, _, value, bound, gap, sigma, defect, success, cost = line.split(" | ")
    assert float(value) == pytest.approx(row.score, abs=1e-6)
    number, _, kind = bound.partition(", ")
    assert float(number) == pytest.approx(row.certified_bound, abs=1e-6)
    assert kind == row.certificate
    assert float(gap) == pytest.approx(row.certified_gap_percent, abs=0.005)
    assert float(sigma) == pytest.approx(row.worst_case_sigma, abs=1e-6)
    assert float(defect) == pytest.approx(row.isotropy_defect, abs=1e-6)
    assert success == f"{row.reached_best} of {row.starts}"
    assert float(cost) == pytest.approx(1e3 * row.cpu_seconds_per_success, rel=0.005)
    eight = [row for row in tables["comparison"] if row.joints == 8]
    without = block("formulations", {**tables, "comparison": eight}).splitlines()
    assert all(line.endswith("| – | – | – | – | – | – | –") for line in without if "7R" in line)


def test_one_study_by_name(tmp_path, monkeypatch):
    words = ["regenerate.py", "comparison", "--starts", "1", "--workers", "1", "--out"]
    monkeypatch.setattr(sys, "argv", [*words, str(tmp_path)])
    assert main() == 0
    page = (tmp_path / "comparison" / "comparison.md").read_text(encoding="utf-8")
    assert "- command: `python regenerate.py comparison --starts 1" in page
    front = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert "| 7R, unit lever arms | max-min       | 0.571483 " in front


def test_a_study_that_fails_stops_no_other(tmp_path, monkeypatch, capsys):
    def failing(effort, folder):
        raise ZeroDivisionError("of all things")
        yield

    def interrupted(effort, folder):
        yield Fact("joints", "7")
        raise KeyboardInterrupt

    existence = STUDIES["existence"]
    studies = {
        "first": replace(existence, name="first", compute=failing),
        "second": replace(existence, name="second", compute=lambda *_: iter([Fact("a", "b")])),
        "third": replace(existence, name="third", compute=interrupted),
        "fourth": replace(existence, name="fourth"),
    }
    monkeypatch.setattr(regenerate, "STUDIES", studies)
    monkeypatch.setattr(regenerate, "front_page", lambda *_: "front")
    monkeypatch.setattr(sys, "argv", ["regenerate.py", *studies, "--out", str(tmp_path)])
    assert main() == 130
    assert (tmp_path / "second" / "README.md").exists()
    assert (tmp_path / "third" / "incomplete" / "README.md").exists()
    assert not list((tmp_path / "first").iterdir())
    assert (tmp_path / "README.md").exists()
    assert not (tmp_path / "fourth").exists()
    assert "of all things" in capsys.readouterr().err


def test_pictures_stand_where_they_are_and_only_there(tmp_path):
    page = front_page(RESULTS, 0)
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page)
    assert len(shown) == len(set(shown)) >= 6
    assert all((RESULTS / file).exists() for file in shown)
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "optima.svg").write_text("<svg/>")
    alone = front_page(tmp_path, 0)
    assert alone.count("](figures/") == alone.count("](figures/optima.svg)") == 1


# Paragraphs made from tables: what they name is in the rows.

NAN = float("nan")


def finding(name, rows):
    """What a study's template says of rows of its main table."""
    others = {stem: [] for stem in STUDIES[name].tables}
    return STUDIES[name].finding({**others, name: rows})


@pytest.mark.parametrize("study", STUDIES.values(), ids=lambda study: study.name)
def test_nothing_from_nothing(study):
    assert study.finding({stem: [] for stem in study.tables}) == ""


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


@pytest.mark.parametrize(
    ("name", "words", "change"),
    [
        ("reproduction", "unexplained", {"verdict": Verdict.MISMATCH}),
        ("failures", "the proved bound is attained by", {"gap_percent": 1.0}),
        ("failures", "joints 0, 1, 2 never failing reaches its bound", {"gap_percent": 1.0}),
        ("robots", "loses full rank whatever the posture", {"structural": ""}),
        ("robots", "Near-structural for KUKA LBR iiwa 14: joint_a4.", {"near_structural": ""}),
        ("comparison", "one factor per failure costs the most", {"relative_cost": NAN}),
        ("comparison", "proved infeasible", {"verdict": "infeasible"}),
    ],
)
def test_a_finding_is_said_only_of_rows_that_have_it(name, words, change):
    rows = STUDIES[name].read(RESULTS / name)[name]
    changed = [replace(row, **change) for row in rows]
    assert (words in finding(name, rows)) is not (words in finding(name, changed))


def test_the_best_and_the_poorest_arm_are_named():
    rows = STUDIES["robots"].read(RESULTS / "robots")["robots"]
    seven = [row for row in rows if (row.joints, row.task_dimension) == (7, 6)]
    ranked = sorted(
        (row for row in seven if not row.structural), key=lambda row: row.percent_of_best_7r
    )
    assert f"{ranked[-1].arm} comes nearest" in finding("robots", rows)
    assert f"{ranked[0].arm} keeps the least" in finding("robots", rows)
