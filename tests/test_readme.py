"""The README's numbers are those of the committed results, and its example runs."""

import csv
import json
import re
import shlex
from pathlib import Path

import pytest

import lockedjoint as lj
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
    lever = arm("lever-revolute", 7)
    row = r"^\| (unit|free.*?) \| (.*?) ?\| (\S+) \| (\S+) \| (\S+) \|$"
    rows = re.findall(row, README, re.MULTILINE)
    expected = (
        ("max-min", "unit-revolute", "", limit),
        ("max-min", "lever-revolute", "", bound("max-min", lever).value),
        ("isotropy", "lever-revolute", "isotropic", bound("isotropy", lever).value),
    )
    for (arms, asked, found, shown, gap), (name, model, special, exact) in zip(
        rows, expected, strict=True
    ):
        assert (arms.startswith("unit"), asked) == (model == "unit-revolute", special)
        # Rounded up: a bound holds as it is printed.
        assert exact <= float(shown) < exact + 1e-5
        best = best_known(name, model, 7)
        assert float(found) == pytest.approx(best, abs=1e-6)
        assert float(gap) == pytest.approx(100 * (1 - best / exact), abs=0.006)


def test_every_link_and_picture_is_there():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target


def test_the_path_that_is_survived_is_that_of_the_table():
    rows = {(row["arm"], row["path"]): row for row in table("paths/paths.csv")}
    row = rows["Franka Panda", "tilting"]
    other, planned = float(row["minimum_norm_percent"]), float(row["percent"])
    assert f"on the minimum-norm trajectory after {other:.1f} % of all failures" in TEXT
    assert f"on the planned trajectory after {planned:.1f} % of them" in TEXT


def test_the_recoveries_are_those_of_the_table():
    rows = list(table("recovery/recovery.csv"))
    tasks, solved, proved, numerical, unknown = (
        sum(int(row[name]) for row in rows)
        for name in ("tasks", "solved", "proved", "numerical", "unknown")
    )
    assert f"was asked about {tasks} failures" in TEXT
    for words, number in (
        ("a trajectory that an independent check passes", solved),
        ("the goal is out of reach, proved with all rounding errors bounded", proved),
        ("the goal is out of reach, by a computation in floating point", numerical),
        ("open", unknown),
    ):
        assert f"| {words} | {number} |" in TEXT
    locked = [
        row for row in rows if "locked" in row["failures"] and "obstacles" not in row["goal"]
    ]
    tasks, unknown_of = (sum(int(row[name]) for row in locked) for name in ("tasks", "unknown"))
    sentence = (
        f"Of the {tasks} failures with locked joints and no obstacles, {unknown_of} are open"
    )
    assert sentence in TEXT


def test_the_failures_of_the_simulated_arm_are_those_of_the_table():
    ends = [(row["trajectory"], row["outcome"]) for row in table("demonstration/failures.csv")]
    planned, other = (ends.count((way, "finished")) for way in ("planned", "minimum norm"))
    assert f"Of the same {len(ends) // 2} failures" in TEXT
    assert f"that `path` planned (right), the path is completed after {planned};" in TEXT
    undecided = ends.count(("minimum norm", "not found"))
    words = f"it is completed after {other}; {undecided} more are undecided"
    assert words in TEXT


def test_the_number_of_reproduced_rows():
    assert f"all {len(table('reproduction/reproduction.csv'))} of them" in README


def test_the_example_runs_and_prints_what_it_says(lockedjoint, tmp_path):
    printed = lockedjoint.python(block("example", "python"), cwd=tmp_path)
    # Of a comment, what stands before "…" is printed.
    shown = re.findall(r"# (\d[^\n…]*)", block("example", "python"))
    assert len(shown) == 3
    relaxed = lj.relaxed(lj.arm("unit-revolute:5,prismatic:2")).value
    assert f"0.4829…, sharper than the relaxation ({relaxed:.4f}…)" in README
    assert all(text in printed for text in (*shown, "('wrist_flex',)"))
    assert "<robot" in (tmp_path / "arm.urdf").read_text()


@pytest.mark.parametrize("marker", ["measure", "posture"])
def test_the_robot_gives_what_is_shown(marker, lockedjoint, tmp_path):
    command, *shown = block(marker, "console").splitlines()
    words = shlex.split(command.removeprefix("$ lockedjoint "))
    lines = iter(lockedjoint.here(*words, cwd=tmp_path).stdout.splitlines())
    # Each line is printed, in this order, and "…" stands for others.
    for line in shown:
        assert line == "…" or any(line.split() == one.split() for one in lines), line


def test_the_first_command_is_near_the_beginning():
    before, _, _ = README.partition("<!-- main job -->")
    assert len(before.split()) <= 120
