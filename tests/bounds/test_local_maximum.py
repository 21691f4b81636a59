"""The known optimum of max-min is a strict local maximum; what is none is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from formulations import measures, residual
from formulations.bounds import local_maximum
from formulations.bounds.local_maximum import prove_local_maximum
from formulations.existence.certificate import CertificateError
from formulations.existence.rings import optimal_jacobian
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from nlp.errors import InputError

COMPARISON = Path(__file__).parents[2] / "results/comparison/jacobians.json"
SEVEN = Arm.of(UnitRevolute(), 7)


@pytest.fixture(scope="module")
def best():
    stored = json.loads(COMPARISON.read_text(encoding="utf-8"))
    found = [one for one in stored if one["model"] == "unit-revolute"]
    return np.array(max(found, key=lambda one: one["worst_case_sigma"])["jacobian"])


def test_the_best_known_7r_is_a_strict_local_maximum(best):
    proved = prove_local_maximum(best)
    assert proved.sigma == pytest.approx(0.5714829682, abs=1e-10)
    assert proved.sigma == pytest.approx(measures.worst_case_sigma(best), abs=1e-9)
    assert proved.distance < 1e-13
    assert 1e-5 < proved.uniqueness < 1e-3
    assert json.loads(json.dumps(proved.to_dict()))["joints"] == 7


def test_nothing_near_it_is_as_good(best):
    """Random steps along the model, turned back into revolute joints."""
    rng, start = np.random.default_rng(0), SEVEN.variables(best)
    for length in (1e-4, 1e-3, 1e-2):
        for _ in range(20):
            step = rng.standard_normal(21)
            moved = SEVEN.jacobian(start + length * step / np.linalg.norm(step))
            assert measures.worst_case_sigma(moved) < measures.worst_case_sigma(best) + 1e-9


@pytest.mark.parametrize("what", ["residual minimum", "random", "8R family"])
def test_what_is_no_isolated_maximum_is_refused(what):
    rng = np.random.default_rng(1)
    if what == "residual minimum":
        matrix = SEVEN.jacobian(residual.minimum(SEVEN, rng))
    else:
        matrix = SEVEN.jacobian(SEVEN.sample(rng)) if what == "random" else optimal_jacobian(8)
    with pytest.raises(CertificateError, match="not proved"):
        prove_local_maximum(matrix)


def test_a_wrong_second_order_is_noticed(best, monkeypatch):
    inertia = local_maximum._inertia

    def fewer(matrix, change):
        found = inertia(matrix, change)
        return (found[0] + 1, found[1] - 1) if len(matrix) > 6 else found

    monkeypatch.setattr(local_maximum, "_inertia", fewer)
    with pytest.raises(CertificateError, match="no strict maximum"):
        prove_local_maximum(best)


def test_more_change_than_there_is_room_for_is_noticed(best, monkeypatch):
    monkeypatch.setattr(local_maximum, "_NEWTON_STEPS", 0)
    blurred = best + 1e-4 * np.random.default_rng(2).standard_normal(best.shape)
    with pytest.raises(CertificateError, match=r"near|another"):
        prove_local_maximum(blurred)


def test_slopes_are_those_of_the_gradient_and_symmetric(best):
    rng = np.random.default_rng(3)
    generators = local_maximum._generators(best)
    x, step = rng.standard_normal((2, 15 * 7 + 5))
    slope = local_maximum._slope(x, best, generators, 1)
    above, below = (
        local_maximum._gradient(x + s * step, best, generators, 1) for s in (1e-5, -1e-5)
    )
    np.testing.assert_allclose((above - below) / 2e-5, slope @ step, atol=1e-6)
    np.testing.assert_allclose(slope, slope.T, atol=1e-10)
    whole = [local_maximum._whole(one) for one in (x, best, *generators)]
    exact = local_maximum._slope(whole[0], whole[1], whole[2:], 1 << 50)
    np.testing.assert_allclose(local_maximum._floats(exact, 2), slope, atol=1e-12)
    assert np.all(exact == exact.T)


def test_an_inertia_is_that_of_all_matrices_that_near():
    values = np.array([2.0, 1.0, 0.5, -0.1, -3.0])
    q = np.linalg.qr(np.random.default_rng(4).standard_normal((5, 5)))[0]
    matrix = local_maximum._whole(q @ np.diag(values) @ q.T, 100)
    assert local_maximum._inertia(matrix, 1e-3) == (3, 2)
    assert local_maximum._inertia(matrix, 0.1) is None


def test_a_square_matrix_is_refused():
    with pytest.raises(InputError):
        prove_local_maximum(np.eye(6))
