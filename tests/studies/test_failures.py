"""The study of several and unequal failures: its rows are what was measured, never its own."""

import csv
import json

import numpy as np
import pytest

from formulations import measures
from formulations.measures.unequal_failures import expected_sigma
from formulations.studies.failures.cases import several, unequal
from formulations.studies.failures.report import summary, write
from formulations.studies.failures.row import solve


@pytest.fixture(scope="module")
def summaries():
    """The planar cases, from a few starts."""
    planar = [case for case in (*several(), *unequal()) if case.task_dimension == 2]
    return [solve(case, starts=2, seed=0, workers=1) for case in planar]


def test_every_case_can_be_stated():
    small = [case for case in (*several(), *unequal()) if case.joints <= 7]
    assert len(small) > 10
    for case in small:
        problem = case.setup.build(case.joints, case.task_dimension)()
        assert problem.size > case.joints


def test_numbers_are_those_of_the_jacobian(summaries):
    for one in summaries:
        row, jacobian = one.row, one.jacobian
        assert row.merit <= row.bound * (1 + 1e-6)
        assert row.gap_percent == pytest.approx(100 * (1 - row.merit / row.bound))
        assert row.worst_case_sigma == measures.worst_case_sigma(jacobian, row.locked)
        if row.failing == "all alike":
            assert row.merit == pytest.approx(row.worst_case_sigma)
    [expected] = [one for one in summaries if one.row.goal == "expected"]
    failures = unequal()[-1].setup.failures
    assert expected.row.merit == expected_sigma(expected.jacobian, failures)


def test_the_paper_s_square_is_the_first_row(summaries):
    row = summaries[0].row
    assert (row.task_dimension, row.joints, row.locked) == (2, 4, 2)
    assert row.merit == pytest.approx(np.sqrt(2) * np.sin(np.pi / 8), abs=1e-6)
    assert row.distinct_optima == 1


def test_files(summaries, tmp_path):
    write(summaries, tmp_path, seed=0, complete=False)
    with (tmp_path / "failures.csv").open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["merit"]) for line in lines] == [one.row.merit for one in summaries]
    page = (tmp_path / "failures.md").read_text(encoding="utf-8")
    assert "not all rows are here" in page
    assert len(summary([one.row for one in summaries])) == len(summaries)
    stored = json.loads((tmp_path / "jacobians.json").read_text(encoding="utf-8"))
    np.testing.assert_array_equal(stored[0]["jacobian"], summaries[0].jacobian)
