"""The README's numbers are those of the committed results, and its example runs."""

import csv
import json
import re
from pathlib import Path

import pytest

from lockedjoint.formulations.bounds.certified import best_known
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.registry import bound

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(marker, language):
    found = re.search(rf"<!-- {marker} -->\n```{language}\n(.*?)```", README, re.DOTALL)
    return found.group(1)


TEXT = " ".join(README.split())


def table(path):
    with (ROOT / "results" / path).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_table_is_the_one_that_the_main_job_wrote():
    lines = (ROOT / "results/comparison/comparison.md").read_text("utf-8").splitlines()
    shown = README.split("<!-- table -->\n")[1].splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert shown[: len(rows)] == rows
    assert len(rows) == len(table("comparison/comparison.csv")) + 2


def test_the_bounds_are_those_on_record():
    record = json.loads((ROOT / "formulations/bounds/record.json").read_text("utf-8"))
    [limit] = [one["bound"] for one in record if one["quantity"] == "max-min"]
    best = best_known("max-min", "unit-revolute", 7)
    limits = r"nothing passes σ = (\S+?),.*?within (\S+) %.*?isotropic passes\s+(\S+?), "
    found = re.search(rf"{limits}.*?nothing at all (\S+?),", README, re.DOTALL)
    unit, gap, isotropic, free = found.groups()
    lever = arm("lever-revolute", 7)
    # Rounded up: a bound holds as it is printed.
    for shown, exact in (
        (unit, limit),
        (isotropic, bound("isotropy", lever).value),
        (free, bound("max-min", lever).value),
    ):
        assert exact <= float(shown) < exact + 1e-5
    assert float(gap) == pytest.approx(100 * (1 - best / limit), abs=0.006)


def test_every_link_and_picture_is_there():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target


def test_the_path_that_is_survived_is_that_of_the_table():
    rows = {(row["arm"], row["path"]): row for row in table("paths/paths.csv")}
    row = rows["Franka Panda", "tilting"]
    assert f"finished after {float(row['minimum_norm_percent']):.1f} % of all" in TEXT
    assert f"finished after {float(row['percent']):.1f} % of them" in TEXT


def test_the_recoveries_are_those_of_the_table():
    rows = list(table("recovery/recovery.csv"))
    tasks, solved, proved, numerical, unknown = (
        sum(int(row[name]) for row in rows)
        for name in ("tasks", "solved", "proved", "numerical", "unknown")
    )
    assert f"Of {tasks} failures" in TEXT
    assert f"answers {solved} with a trajectory" in TEXT
    assert f"proves that {proved} goals are out of reach" in TEXT
    assert f"by a computation in floating point {numerical} more are" in TEXT
    locked = [
        row for row in rows if "locked" in row["failures"] and "obstacles" not in row["goal"]
    ]
    tasks, unknown_of = (sum(int(row[name]) for row in locked) for name in ("tasks", "unknown"))
    assert f"{unknown} are left open, {unknown_of} of the {tasks} with locked joints" in TEXT


def test_the_failures_of_the_simulated_arm_are_those_of_the_table():
    ends = [(row["trajectory"], row["outcome"]) for row in table("demonstration/failures.csv")]
    planned, other = (ends.count((way, "finished")) for way in ("planned", "minimum norm"))
    assert f"finishes its path after {other} of {len(ends) // 2} failures" in TEXT
    assert f"on the planned one (right) after {planned}" in TEXT


def test_the_number_of_reproduced_rows():
    assert f"all {len(table('reproduction/reproduction.csv'))} of them" in README


def test_the_example_runs_and_prints_what_it_says(lockedjoint):
    printed = lockedjoint.python(block("example", "python"))
    shown = re.findall(r"# (\d[^\n]*?)(?:\.\.\.)?\n", block("example", "python"))
    assert len(shown) == 3
    assert all(text in printed for text in (*shown, "<robot"))
