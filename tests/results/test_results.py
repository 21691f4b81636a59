"""The committed results are what the code computes, and their pages say what their tables say.

What is quick is computed again: optima and bounds agree within 1e-6, which is what counts as
the same optimum, and verdicts agree. Counts of starts and times are the machine's and are not
compared. What takes long is measured again from what is on record. The comparisons and the
reproduction are computed again in tests/formulations.
"""

import json
import re
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import sharpest_worst_case_of
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.comparison import ComparisonRow
from lockedjoint.formulations.existence.reading import read_certificate
from lockedjoint.formulations.existence.verify import verify_nonexistence
from lockedjoint.formulations.io.table import read_rows
from lockedjoint.paths.survival import survivors
from lockedjoint.synthesis.criteria import CRITERIA, Sampling
from lockedjoint.synthesis.family import Arrangements, family
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.workspaces.planar import Planar3R
from results.bounds import bounds as bounds_study
from results.bounds.bounds import BoundRow
from results.demonstration import demonstration
from results.demonstration.demonstration import TrajectoryRow, failure_of
from results.existence import existence as existence_study
from results.failures.failures import FailureRow
from results.inverse_kinematics import inverse_kinematics
from results.inverse_kinematics.inverse_kinematics import StepRow
from results.paths.paths import PATHS, PathRow
from results.regenerate import STUDIES, front_page
from results.robots.robots import RobotRow
from results.workspaces.workspaces import FINAL_POINTS, HALF, OrderRow, WorkspaceRow

RESULTS = Path(__file__).parents[2] / "results"
# What counts as the same optimum, and as the same bound.
SAME = 1e-6


def rows(name, kind, table=None):
    return read_rows(RESULTS / name / f"{table or next(iter(STUDIES[name].tables))}.csv", kind)


def test_the_planar_workspaces():
    closed = [row for row in rows("workspaces", WorkspaceRow) if row.method == "closed form"]
    choices = ["as given", "best limits", "best limits and lengths"]
    assert [row.choice for row in closed] == choices
    for row in closed:
        limits = tuple((low, high) for low, high in row.limits.values())
        anew = Planar3R(tuple(row.links.values()), limits)
        assert anew.area_with_error()[0] == pytest.approx(row.size, abs=SAME)


def test_every_rigorous_bound_is_what_its_certificate_states():
    certificates = RESULTS / "bounds" / bounds_study.CERTIFICATES
    names = {row.file: row for row in rows("bounds", BoundRow)}
    assert set(names) == {path.name for path in certificates.iterdir()}
    for name, row in names.items():
        certificate = read_any(certificates / name)
        quantity = getattr(certificate, "quantity", "isotropy")
        assert (quantity, certificate.bound) == (row.quantity, row.bound)


def test_the_certificate_on_record_has_the_figures_of_the_table():
    certificate = read_certificate(RESULTS / "existence" / "certificate.json")
    facts = rows("existence", existence_study.Fact)
    assert existence_study.facts(certificate, verify_nonexistence(certificate)) == facts
    optimal = rows("existence", existence_study.OptimalRow, "optimal")
    assert [row.joints for row in optimal] == [8, 9, 10, 11, 12, 13]
    for row in optimal:
        assert existence_study.optimal_row(RESULTS / "existence" / row.file) == row


@pytest.mark.parametrize("name", ["comparison", "comparison_8r"])
def test_jacobians_of_the_comparison(name):
    stored = json.loads((RESULTS / name / "jacobians.json").read_text(encoding="utf-8"))
    for one, row in zip(stored, rows(name, ComparisonRow), strict=True):
        assert (one["formulation"], one["model"]) == (row.formulation, row.model)
        sigma = measures.worst_case_sigma(one["jacobian"])
        defect = measures.isotropy_defect(one["jacobian"])
        assert defect == pytest.approx(row.isotropy_defect, abs=1e-12)
        if row.verdict == "solved":
            assert sigma == pytest.approx(row.worst_case_sigma, abs=1e-12)
            gap = 100 * abs(1 - sigma / row.sigma_bound)
            assert row.sigma_gap_percent == pytest.approx(gap, abs=1e-9)


def test_jacobians_of_the_failures():
    stored = json.loads((RESULTS / "failures/jacobians.json").read_text(encoding="utf-8"))
    for one, row in zip(stored, rows("failures", FailureRow), strict=True):
        if row.failing == "all alike" and row.maximise == "worst":
            jacobian = np.array(one["jacobian"])
            sigma = measures.worst_case_sigma(jacobian, row.failures)
            assert sigma == pytest.approx(row.score, abs=1e-12)
            mean = measures.sigma_bound(*jacobian.shape, measures.trace(jacobian), row.failures)
            assert sigma - SAME <= row.bound <= mean + SAME
            bound = sharpest_worst_case_of(jacobian, row.failures).value
            assert bound == pytest.approx(row.bound, abs=SAME)


def test_postures_of_the_robots_are_those_of_the_table():
    stored = json.loads((RESULTS / "robots/postures.json").read_text(encoding="utf-8"))
    by_arm = {(posture["arm"], posture["variant"]): posture for posture in stored}
    for row in rows("robots", RobotRow):
        posture = by_arm[row.arm, row.task]
        assert posture["worst_case_sigma"] == pytest.approx(row.worst_case_sigma, abs=1e-12)
        assert posture["q"] == row.q


def test_trajectories_survive_what_the_table_says():
    stored = json.loads((RESULTS / "paths/trajectories.json").read_text(encoding="utf-8"))
    table = rows("paths", PathRow)
    assert [(one.arm, one.path) for one in PATHS] == [(row.arm, row.path) for row in table]
    for one, row in zip(stored, table, strict=True):
        share = 100 * np.mean(one["survivors"]) / row.joints
        assert share == pytest.approx(row.percent)
        assert not row.minimum_norm_percent > row.percent
        assert row.percent <= row.best_of_samples_percent + 1e-9
    # One of them is measured again from the configurations that are stored.
    arm, path = PATHS[0].stated()
    q = np.array(stored[0]["configurations"])
    _, poses, _ = path.sampled(len(q), 10.0)
    ends = survivors(arm.chain, q.T, np.arange(len(q)), poses)
    kept = 100 * np.mean(ends == len(q) - 1)
    assert kept == pytest.approx(table[0].percent, abs=0.5)


def test_bounded_steps_reach_more_goals_from_the_same_starts():
    table = rows("inverse_kinematics", StepRow)
    assert len(table) == 2 * len(inverse_kinematics.STATES) * len(inverse_kinematics.GOALS)
    for before, after in zip(table[::2], table[1::2], strict=True):
        assert (before.step, after.step) == ("cut off", "bounded")
        assert (before.state, before.goal, before.goals) == (
            after.state,
            after.goal,
            after.goals,
        )
        assert after.percent > before.percent
        assert after.missed <= before.missed


def test_failures_of_the_simulated_arm_add_up_to_the_table():
    failures = pd.read_csv(RESULTS / "demonstration/failures.csv")
    for row in rows("demonstration", TrajectoryRow):
        own = failures[failures.trajectory == row.trajectory]
        assert demonstration.row_of(row.trajectory, own) == row


@pytest.mark.slow
def test_a_failure_of_the_simulated_arm_ends_as_the_table_says():
    """Proved to leave no way along one trajectory, survived along the other."""
    pytest.importorskip("toppra")
    file = RESULTS / "demonstration/trajectories.json"
    tracks = {k: np.array(q) for k, q in json.loads(file.read_text(encoding="utf-8")).items()}
    failures = pd.read_csv(RESULTS / "demonstration/failures.csv").to_dict("records")
    ended = ["impossible, proved", "finished"]
    pairs = zip(failures[::2], failures[1::2], strict=True)
    for end in next(pair for pair in pairs if [one["outcome"] for one in pair] == ended):
        name, number, joint, moment, outcome, *_ = end.values()
        again = failure_of(name, tracks[name], number, joint - 1, moment)
        assert again["outcome"] == outcome
        for value, error in (("noticed_after", 0.02), ("until_standing", 0.5)):
            assert again[value] == pytest.approx(end[value], abs=error)
    assert again["way_back"] < 10  # it goes on from where it stands
    assert again["going_on"] < 1
    healthy = failure_of("planned", tracks["planned"], 0, 0, 7.0)  # the path takes six seconds
    assert np.isnan(healthy["noticed_after"])
    assert healthy["until_standing"] < 1


def test_the_robots_of_a_jacobian_keep_what_the_table_says():
    """Measured again at other points; the error of the table is two standard errors."""
    table = rows("workspaces", OrderRow, "orders")
    assert table
    for row in table:
        jacobian = np.array(list(row.jacobian.values()))
        sigma = measures.worst_case_sigma(jacobian)
        assert sigma == pytest.approx(row.worst_case_sigma, abs=1e-12)
        assert 0 <= row.least <= row.middle < row.kept
        order = [int(one) for one in row.order.split()]
        arm = realise(jacobian).arranged(order)
        one = family(arm, Arrangements(np.arange(7)[None], np.zeros((1, 7), dtype=bool)))
        how = Sampling(seed=99, samples=100, radius=HALF)
        again = float(CRITERIA["kept"].evaluate(one, how)[0])
        assert abs(again - row.kept) < row.error * (1 + 1.5 * np.sqrt(FINAL_POINTS / 100))
    # The front, by sorting: whoever keeps more than all with a larger worst case.
    ranked = sorted(table, key=lambda row: -row.worst_case_sigma)
    most = np.maximum.accumulate([0.0, *(row.kept for row in ranked)])
    front = [row.kept > best for row, best in zip(ranked, most[:-1], strict=True)]
    assert [row.front == "yes" for row in ranked] == front


def test_the_lengths_of_the_links_are_worth_choosing():
    found = {row.choice: row for row in rows("workspaces", WorkspaceRow) if row.arm == "UR5"}
    given, chosen = found["best limits"], found["best limits and lengths"]
    assert chosen.size - chosen.error > given.size + given.error
    assert sum(chosen.links.values()) == pytest.approx(sum(given.links.values()), rel=1e-12)


def test_points_of_the_trade_off():
    points = pd.read_csv(RESULTS / "figures/trade-off.csv")
    assert len(points) > 10
    for _, point in points.iterrows():
        jacobian = json.loads(point.jacobian)
        sigma, defect = measures.worst_case_sigma(jacobian), measures.isotropy_defect(jacobian)
        assert sigma == pytest.approx(point.worst_case_sigma, abs=1e-12)
        assert defect == pytest.approx(point.isotropy_defect, abs=1e-12)


def test_bounds_are_those_of_their_files():
    listed = rows("bounds", BoundRow)
    files = {path.name for path in (RESULTS / "bounds").glob("*.json")}
    assert {row.file for row in listed} == files == set(bounds_study.RUNS)
    for row in listed:
        plain = json.loads((RESULTS / "bounds" / row.file).read_text(encoding="utf-8"))
        assert row.command == bounds_study.RUNS[row.file][1]
        made = {name: getattr(row, name) for name in ("versions", "machine", "date")}
        assert bounds_study.row_of(plain, file=row.file, command=row.command, **made) == row


def body(text):
    """A page without what its run alone knows: command, seed, versions, machine, date."""
    header = dict(re.findall(r"^- (\w+): (.*)$", text, re.MULTILINE))
    assert all(header.get(name) for name in ("command", "seed", "versions", "machine", "date"))
    own = r"^- (command|commit|seed|versions|machine|date|peers|robots): .*\n"
    return re.sub(own, "", text, flags=re.MULTILINE)


@pytest.mark.parametrize("study", STUDIES.values(), ids=lambda study: study.name)
def test_every_page_is_what_its_template_makes_of_its_tables(study, tmp_path):
    folder = RESULTS / study.name
    tables = study.read(folder)
    assert all(tables.values())
    # Written once; a run writes after every row, which tests/results/test_study.py has.
    study._write(tmp_path, list(chain.from_iterable(tables.values())), 0, complete=True)
    for name in (*(f"{stem}.csv" for stem in tables), study.page):
        committed, made = ((place / name).read_text("utf-8") for place in (folder, tmp_path))
        if name == study.page:
            committed, made = body(committed), body(made)
        assert name == "trade-off.csv" or made == committed
    assert len(study.finding(tables)) > 60


def test_the_front_page_is_what_its_template_makes_of_all_tables():
    front = (RESULTS / "README.md").read_text(encoding="utf-8")
    assert body(front_page(RESULTS, 0)) == body(front)


def test_every_folder_is_a_study_whose_script_is_there():
    hidden = (".", "_")
    folders = {path.name for path in RESULTS.iterdir() if path.is_dir()}
    assert {name for name in folders if not name.startswith(hidden)} == set(STUDIES)
    for study in STUDIES.values():
        first, second = study.command.split()
        assert first == "python"
        assert (RESULTS.parent / second).is_file()
        assert Path(second).parent.name == study.name
