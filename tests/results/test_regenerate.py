"""Studies are run one after another; the front page says what the tables show, no more."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from lockedjoint.formulations.reproduction.row import Verdict
from results import pages, regenerate
from results.existence.existence import Fact
from results.regenerate import STUDIES, TEMPLATE, front_page, main, read_all, values

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
    # But for the heading of a column.
    assert "proved" not in page.replace("proved bound", "")


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


def test_a_study_that_fails_stops_no_other(tmp_path, monkeypatch, capsys):
    def failing(effort, folder):
        raise ZeroDivisionError("of all things")
        yield

    def interrupted(effort, folder):
        yield Fact("joints", "7")
        raise KeyboardInterrupt

    existence = STUDIES["existence"]
    one = lambda *_: iter([Fact("a", "b")])  # noqa: E731
    computed = {"first": failing, "second": one, "third": interrupted, "fourth": failing}
    studies = {k: replace(existence, name=k, compute=own) for k, own in computed.items()}
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


# Paragraphs made from tables: what they name is in the rows.

NAN = float("nan")


def finding(name, rows):
    """What a study's template says of rows of its main table."""
    others = {stem: [] for stem in STUDIES[name].tables}
    return STUDIES[name].finding({**others, name: rows})


@pytest.mark.parametrize("study", STUDIES.values(), ids=lambda study: study.name)
def test_nothing_from_nothing(study):
    assert study.finding({stem: [] for stem in study.tables}) == ""


@pytest.mark.parametrize(
    ("name", "words", "change"),
    [
        ("reproduction", "unexplained", {"verdict": Verdict.MISMATCH}),
        ("failures", "these attain the proved bound:", {"gap_percent": 1.0}),
        ("failures", "2 never fail, unit-revolute 6×7 reaches its bound", {"gap_percent": 1.0}),
        ("robots", "loses full rank at every posture", {"structural": ""}),
        ("robots", "near-structural: KUKA LBR iiwa 14 (joint_a4)", {"near_structural": ""}),
        ("comparison", "one factor per failure costs the most", {"relative_cost": NAN}),
        ("comparison", "proved infeasible", {"verdict": "infeasible"}),
    ],
)
def test_a_finding_is_said_only_of_rows_that_have_it(name, words, change):
    rows = STUDIES[name].read(RESULTS / name)[name]
    changed = [replace(row, **change) for row in rows]
    assert (words in finding(name, rows)) is not (words in finding(name, changed))
