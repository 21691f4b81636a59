"""Third statement: the best worst case among exactly isotropic Jacobians."""

from functools import partial

import numpy as np
import pytest

from formulations import isotropy, measures
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
