"""The gate: nothing that did not converge to a feasible point is called solved or best."""

from dataclasses import replace

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.formulations.comparison import row_of


@pytest.fixture(scope="module")
def unfinished():
    """Two starts of max-min stopped after three iterations: none converged."""
    return lj.solve("max-min", joints=7, starts=2, workers=1, options={"max_iter": 3})


def test_a_verdict_of_solved_needs_a_converged_start(unfinished):
    assert set(unfinished.status_counts) == {"Maximum_Iterations_Exceeded"}
    assert unfinished.verdict == "not solved"
    assert unfinished.reached == ()
    assert "solved," not in repr(unfinished)
    assert "not solved; least violation 0." in repr(unfinished)
    assert not any(record.trusted for record in unfinished.records)


def test_what_is_feasible_is_called_no_more_than_that(unfinished):
    near = [replace(record, violation=1e-9) for record in unfinished.records]
    outcome = replace(unfinished, records=tuple(near))
    best = max(record.worst_case_sigma for record in near)
    assert outcome.best.score == best
    assert f"not solved; best feasible point {best:.9g}" in repr(outcome)


def test_a_start_that_did_not_converge_is_not_the_best():
    outcome = lj.solve("max-min", "free", 3, 2, starts=4, workers=1)
    status = replace(outcome.best.status, return_status="Maximum_Iterations_Exceeded")
    better = replace(outcome.best, status=status, score=2.0, worst_case_sigma=2.0)
    infeasible = replace(outcome.best, violation=1e-3, score=3.0, worst_case_sigma=3.0)
    with_both = replace(outcome, records=(*outcome.records, better, infeasible))
    assert with_both.best.score == pytest.approx(np.sqrt(1 / 2), abs=1e-7)
    assert with_both.reached == outcome.reached
    usual, row = row_of(outcome), row_of(with_both)
    names = ("verdict", "score", "worst_case_sigma", "reached_best", "violation")
    for name in (*names, "distinct_optima"):
        assert getattr(row, name) == getattr(usual, name)


def test_the_share_of_optima_that_no_start_has_seen(unfinished):
    """Boender and Rinnooy Kan: expected are w(N − 1)/(N − w − 2) optima if N starts saw w."""
    outcome = lj.solve("max-min", "free", 3, 2, starts=4, workers=1)
    scores = [0.7, 0.7 + 1e-9, 0.7, 0.5, 0.5, 0.3, 0.7, 0.5, 0.3, 0.3]
    records = tuple(replace(outcome.best, score=score) for score in scores)
    seen = replace(outcome, records=(*records, *unfinished.records))
    assert seen.scores == (0.3, 0.5, 0.7)
    starts, optima = len(scores), 3
    expected = optima * (starts - 1) / (starts - optima - 2)
    assert seen.unseen_share == pytest.approx(1 - optima / expected)
    assert unfinished.scores == ()
    assert unfinished.unseen_share == 1.0
