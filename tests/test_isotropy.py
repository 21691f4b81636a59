"""Third statement: the best worst case among exactly isotropic Jacobians."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations import isotropy, measures
from formulations.atlas.collection import page_of
from formulations.atlas.entry import entry
from formulations.bounds.closed_form import isotropic_unit_bound
from formulations.joints.joint import NotInModelError
from formulations.joints.models import arm
from nlp.multistart import multistart


def run(built, starts, seed=0):
    build = partial(isotropy.build, built)
    return multistart(build, built.sample, starts=starts, rng=seed).results


@pytest.mark.parametrize(
    ("model", "n", "m"),
    [("free", 3, 2), ("free", 6, 3), ("free-mean", 5, 3), ("unit-revolute", 8, 6)],
)
def test_meets_the_equations_and_the_bound_where_it_can(model, n, m):
    built = arm(model, n, m)
    for run_ in run(built, 3):
        jacobian = run_.solution.outputs["jacobian"]
        assert run_.solution.status.success
        assert measures.is_optimally_failure_tolerant(jacobian)
        assert isotropy.score(jacobian) == pytest.approx(
            measures.sigma_bound(m, n, built.largest_trace), abs=1e-7
        )


def test_unit_revolute_7r_is_seen_to_be_infeasible():
    for run_ in run(arm("unit-revolute", 7), 5):
        assert run_.solution.status.return_status == "Infeasible_Problem_Detected"
        assert run_.solution.violation > 0.05
        assert isotropy.score(run_.solution.outputs["jacobian"]) == -np.inf


def test_free_lever_arms_of_bounded_length_are_infeasible_too():
    """Isotropy forces mean |v|² = 1, so |v_i| ≤ 1 leaves unit revolute joints only.

    Ipopt's point may meet the equations by breaking a bound: the model has the last word.
    """
    built = arm("lever-revolute-each", 7)
    for run_ in run(built, 4):
        jacobian = run_.solution.outputs["jacobian"]
        assert not run_.solution.status.success
        isotropic = np.isfinite(isotropy.score(jacobian))
        if isotropic:
            with pytest.raises(NotInModelError):
                built.variables(jacobian)


def test_free_lever_arms_give_isotropic_7r():
    built = arm("lever-revolute", 7)
    runs = run(built, 20)
    scores = np.array([isotropy.score(r.solution.outputs["jacobian"]) for r in runs])
    assert np.sum(np.abs(scores - 0.480383041) < 1e-6) >= 18
    jacobian = runs[int(np.argmax(scores))].solution.outputs["jacobian"]
    built.variables(jacobian)
    np.testing.assert_allclose(jacobian @ jacobian.T, 7 / 3 * np.eye(6), atol=1e-8)
    longest = np.max(np.sum(jacobian[:3] ** 2, axis=0))
    assert measures.worst_case_sigma(jacobian) == pytest.approx(np.sqrt(4 / 3 - longest))


def test_score_refuses_what_is_not_isotropic():
    jacobian = np.random.default_rng(0).normal(size=(3, 5))
    assert isotropy.score(jacobian) == -np.inf
    frame = np.linalg.qr(jacobian.T)[0].T
    assert isotropy.score(frame) == measures.worst_case_sigma(frame)


@pytest.mark.parametrize(
    ("m", "n", "locked", "square"),
    [
        (2, 5, 2, 5 / 2 - 1 - np.cos(np.pi / 5)),  # lines at equal angles
        (2, 6, 3, 3 - 1.5 - np.sqrt(3) / 2),  # three lines, each twice
        (3, 7, 2, 7 / 3 - 1 - 1 / np.sqrt(3)),  # diagonals and axes of a cube
    ],
)
def test_several_failures_of_unit_columns(m, n, locked, square):
    built = arm("free", n, m)
    build = partial(isotropy.build, built, locked)
    scores = [
        isotropy.score(run_.solution.outputs["jacobian"], locked)
        for run_ in multistart(build, built.sample, starts=4, rng=0).results
    ]
    assert max(scores) == pytest.approx(np.sqrt(square), abs=1e-8)
    limit = isotropy.bound(built, locked).value
    assert max(scores) - 1e-12 <= limit <= np.sqrt(square) * (1 + 1e-12)


def test_several_failures_agree_with_max_min_where_the_best_is_isotropic():
    built = arm("free-mean", 6, 2)
    build = partial(isotropy.build, built, 2)
    best = max(
        isotropy.score(run_.solution.outputs["jacobian"], 2)
        for run_ in multistart(build, built.sample, starts=6, rng=0).results
    )
    assert best == pytest.approx(float(page_of(entry("free-mean_2x6_k2")).value), abs=1e-8)


@given(st.sampled_from([2, 3, 4]), st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_no_union_of_bases_beats_the_bound(m, bases, seed):
    rng = np.random.default_rng(seed)
    drawn = [np.linalg.qr(rng.standard_normal((m, m)))[0] for _ in range(bases)]
    jacobian = np.hstack(drawn)
    for locked in range(1, m * bases - m + 1):
        limit = isotropic_unit_bound(m, m * bases, min(locked, 4))
        assert measures.worst_case_sigma(jacobian, min(locked, 4)) ** 2 <= limit + 1e-12
