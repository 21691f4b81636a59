"""The study of several and unequal failures: its rows are what was measured, never its own."""

import json

import numpy as np
import pytest

from formulations import comparison, measures
from formulations.io.study import INCOMPLETE, Effort
from formulations.measures.unequal_failures import expected_sigma
from formulations.solving import solve
from results.failures import failures
from results.failures.failures import STUDY, several, unequal


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The study of the planar cases, from a few starts; interrupted at the next case."""
    cases = sorted((*several(), *unequal()), key=lambda case: case.arm.shape[0])

    def run(case, **keywords):
        if case.arm.shape[0] > 2:
            raise KeyboardInterrupt
        return solve.run(case, **keywords)

    folder = tmp_path_factory.mktemp("failures")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(failures, "several", lambda: cases)
        patch.setattr(failures, "unequal", lambda: [])
        patch.setattr(comparison, "run", run)
        assert not STUDY.run(folder, Effort(starts=2)).complete
    return folder / INCOMPLETE


@pytest.fixture(scope="module")
def study_rows(folder):
    """Rows and their Jacobians."""
    stored = json.loads((folder / "jacobians.json").read_text(encoding="utf-8"))
    jacobians = [np.array(one["jacobian"]) for one in stored]
    rows = STUDY.read(folder)["failures"]
    assert [one["score"] for one in stored] == [row.score for row in rows]
    return list(zip(rows, jacobians, strict=True))


def test_numbers_are_those_of_the_jacobian(study_rows):
    for row, jacobian in study_rows:
        assert row.score <= row.bound * (1 + 1e-6)
        assert row.gap_percent == pytest.approx(100 * abs(1 - row.score / row.bound))
        assert row.worst_case_sigma == measures.worst_case_sigma(jacobian, row.locked)
        if row.failing == "all alike":
            assert row.score == pytest.approx(row.worst_case_sigma)
    [(row, jacobian)] = [one for one in study_rows if one[0].goal == "expected"]
    assert row.score == expected_sigma(jacobian, unequal()[-1].settings["failures"])


def test_the_paper_s_square_is_the_first_row(study_rows):
    row, _ = study_rows[0]
    assert (row.task_dimension, row.joints, row.locked) == (2, 4, 2)
    assert row.score == pytest.approx(np.sqrt(2) * np.sin(np.pi / 8), abs=1e-6)
    assert row.distinct_optima == 1
