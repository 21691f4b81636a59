"""``lockedjoint figure``, from its arguments to its files and messages."""

import csv
import json
from functools import partial

import pytest

from lockedjoint.figures import optima
from lockedjoint.figures.style import read_look
from lockedjoint.formulations.campaign.records import open_store

GIVEN = ("figure", "singular-values", "j.csv", "--out")


@pytest.fixture
def planar(tmp_path):
    (tmp_path / "j.csv").write_text("1,0.4,-0.5,0.2\n0,1,0.7,-0.6\n", encoding="utf-8")
    return tmp_path


@pytest.fixture
def run(lockedjoint, planar):
    return partial(lockedjoint.here, cwd=planar)


def test_a_figure_its_data_and_its_json(run, planar):
    done = run(*GIVEN, "new/f.pdf", "--out", "f.csv", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert (planar / "new" / "f.pdf").read_bytes().startswith(b"%PDF")
    rows = json.loads(done.stdout)["rows"]
    with (planar / "f.csv").open(encoding="utf-8") as file:
        written = list(csv.DictReader(file))
    assert [row["value"] for row in rows] == [float(row["value"]) for row in written]


def test_a_campaign_is_shown_and_its_starts_are_counted_by_the_gate(run, planar):
    """As `Record.trusted`: acceptable answers count, those that violate a constraint do not."""
    encodings = ["shared-factor", "factor-per-deletion"]
    (planar / "study.toml").write_text(
        'starts = 4\nmodels = ["free"]\njoints = [4]\ntask_dimensions = [3]\n'
        f'formulations = ["residual", "max-min"]\nencodings = {encodings}\n'
    )
    assert run("campaign", "study.toml", "s.db", "--workers", 1).returncode == 0
    done = run("figure", "optima", "s.db", "--out", "x.svg", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    names = {f"max-min, 4 × free encoding {encoding}" for encoding in encodings}
    shown = {row["problem"] for row in json.loads(done.stdout)["rows"]}
    assert shown == {*names, "residual, 4 × free"}
    assert all(row["counted"] for row in optima.stored(planar / "s.db"))
    ends = ("Solved_To_Acceptable_Level", "Maximum_Iterations_Exceeded")
    changes = [*({"status": end} for end in ends), {"violation": 1e-3}, {"valid": 0}]
    with (
        open_store(planar / "s.db") as store,
        open_store(planar / "t.db", writable=True) as changed,
    ):
        rows = store.frame().to_dict("records")[:4]
        made = [{**row, **change} for row, change in zip(rows, changes, strict=True)]
        changed.add(rows[0]["cell"], list(enumerate(made)), rows[0]["environment"])
    counted = {row["start"]: row["counted"] for row in optima.stored(planar / "t.db")}
    assert counted == {0: True, 1: False, 2: False, 3: False}


@pytest.mark.parametrize(
    ("size", "inches"),
    [("10x8", (10 / 2.54, 8 / 2.54)), ("5 x 4cm", (5 / 2.54, 4 / 2.54)), ("5x.9in", (5, 0.9))],
)
def test_the_size_is_in_cm_or_inches(size, inches):
    assert read_look(size, True, None).size == pytest.approx(inches)


@pytest.mark.parametrize(
    ("line", "taken"),
    [
        ("xtick.labelcolor: ab12cd", True),
        ("axes.prop_cycle: cycler", False),
        ("axes.titlesize: enormous", False),
        ("font.size: 1e300", False),
    ],
)
def test_a_style_file_changes_looks_or_is_refused(run, planar, line, taken):
    (planar / "s.mplstyle").write_text(f"{line}\n", encoding="utf-8")
    done = run(*GIVEN, "f.svg", "--figure-style", "s.mplstyle")
    assert done.returncode == (0 if taken else 2)
    assert done.stderr.count("\n") == (0 if taken else 1)
    assert (planar / "f.svg").exists() == taken
    assert not taken or "#ab12cd" in (planar / "f.svg").read_text(encoding="utf-8")
