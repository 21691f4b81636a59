"""The README's numbers are those of the committed results, and its example runs."""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from formulations.joints.models import arm
from formulations.registry import bound

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(marker, language):
    found = re.search(rf"<!-- {marker} -->\n```{language}\n(.*?)```", README, re.DOTALL)
    return found.group(1)


TEXT = " ".join(README.split())


def table(path):
    with (ROOT / "results" / path).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def comparison():
    rows = table("comparison/comparison.csv")
    return {(row["formulation"], row["model"]): row for row in rows if not row["variant"]}


@pytest.mark.parametrize(
    ("line", "key"),
    [
        (
            "least residual, unit lever arms: the paper's eq. (46)",
            ("residual", "unit-revolute"),
        ),
        ("max-min, unit lever arms", ("max-min", "unit-revolute")),
        ("max-min, free lever arms of the same mean square", ("max-min", "lever-revolute")),
        ("exactly isotropic, free lever arms", ("isotropy", "lever-revolute")),
    ],
)
def test_the_table_is_the_committed_comparison(comparison, line, key):
    row = comparison[key]
    [shown] = [text for text in README.splitlines() if text.startswith(f"| {line} |")]
    sigma, gap, reached = [cell.strip(" *") for cell in shown.strip("|").split("|")[1:]]
    assert sigma == f"{float(row['worst_case_sigma']):.5f}"
    assert gap == f"{float(row['certified_gap_percent']):.2f} %"
    assert reached == f"{row['reached_best']} of {row['starts']}"


def test_the_bounds_are_those_on_record():
    record = json.loads((ROOT / "formulations/bounds/record.json").read_text("utf-8"))
    limit = min(
        one["bound"]
        for one in record
        if (one["quantity"], one["kind"]) == ("max-min", "rigorous")
    )
    jacobians = json.loads((ROOT / "results/comparison/jacobians.json").read_text("utf-8"))
    best = max(
        one["worst_case_sigma"]
        for one in jacobians
        if (one["formulation"], one["model"]) == ("max-min", "unit-revolute")
    )
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


def test_the_infeasible_row_is_the_committed_one(comparison):
    assert comparison["isotropy", "unit-revolute"]["verdict"] == "proved infeasible"
    assert "| exactly isotropic, unit lever arms | – | – | proved infeasible |" in README


def test_the_workspaces_are_those_of_the_table():
    rows = {(row["arm"], row["choice"]): row for row in table("workspaces/workspaces.csv")}
    physical, best = (rows["Franka Panda", name] for name in ("physical limits", "best limits"))
    assert (physical["size"], physical["fatal"]) == ("0.0", "panda_joint4")
    assert f"fill {float(physical['physical']):.2f} m³" in README
    kept = f"keeps {float(best['size']):.2f} m³, {float(best['percent_kept']):.0f} %"
    assert kept in README


def test_the_path_that_is_survived_is_that_of_the_table():
    rows = {(row["arm"], row["path"]): row for row in table("paths/paths.csv")}
    row = rows["Franka Panda", "tilting"]
    assert f"finished after {float(row['minimum_norm_percent']):.1f} % of all" in TEXT
    assert f"finished after {float(row['percent']):.1f} % of them" in TEXT


def test_the_robots_of_the_best_jacobian_are_those_of_the_table():
    rows = sorted(
        table("workspaces/orders.csv"), key=lambda row: float(row["worst_case_sigma"])
    )
    [residual] = [row for row in rows if row["statement"] == "residual"]
    best = rows[-1]
    assert f"have σ = {float(best['worst_case_sigma']):.5f} where" in TEXT
    assert f"keeps {float(best['kept']):.2f} cubic lever arms" in TEXT
    assert f"40 random orders keeps {float(best['middle']):.2f}" in TEXT
    assert f"keeps as much, {float(residual['kept']):.2f}" in TEXT


def test_the_number_of_reproduced_rows():
    assert f"all {len(table('reproduction/reproduction.csv'))} of them" in README


def test_the_example_runs_and_prints_what_it_says():
    done = subprocess.run(
        [sys.executable, "-c", block("example", "python")],
        **{"cwd": ROOT, "capture_output": True, "text": True, "check": True, "timeout": 120},
    )
    shown = re.findall(r"# (\d[^\n]*?)(?:\.\.\.)?\n", block("example", "python"))
    assert len(shown) == 2
    for text in shown:
        assert text in done.stdout
    assert "<robot" in done.stdout
