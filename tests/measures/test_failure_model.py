"""Failure models: shares against probabilities summed over all outcomes, and bad input."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.measures.unequal_failures import FailureModel
from nlp.errors import InputError

probabilities = st.lists(
    st.one_of(st.just(0.0), st.floats(0.001, 0.95)), min_size=3, max_size=6
).filter(lambda values: sum(value > 0 for value in values) >= 2)


def outcomes(values):
    """Every pattern of failed joints with its probability, one joint after the other."""
    for pattern in product((False, True), repeat=len(values)):
        factors = [p if failed else 1 - p for p, failed in zip(values, pattern, strict=True)]
        yield tuple(i for i, failed in enumerate(pattern) if failed), np.prod(factors)


@given(probabilities, st.integers(1, 2))
def test_shares_are_conditional_probabilities(values, locked):
    exact = {joints: p for joints, p in outcomes(values) if len(joints) == locked and p > 0}
    total = sum(exact.values())
    shares = FailureModel(tuple(values), locked).shares()
    assert list(shares) == sorted(exact)
    for joints, share in shares.items():
        assert share == pytest.approx(exact[joints] / total)


@given(probabilities, st.integers(1, 2))
def test_weights_are_shares_over_the_largest(values, locked):
    model = FailureModel(tuple(values), locked)
    shares, weights = model.shares(), model.weights()
    assert max(weights.values()) == 1
    for joints, weight in weights.items():
        assert weight == pytest.approx(shares[joints] / max(shares.values()))


def test_joints_that_never_fail():
    model = FailureModel.equally_likely(5, 2, never=(0, 3))
    assert model.fallible == (1, 2, 4)
    assert model == FailureModel((0.5,) * 5, 2).sparing([3, 0])
    assert dict(model.shares()) == pytest.approx({(1, 2): 1 / 3, (1, 4): 1 / 3, (2, 4): 1 / 3})


@pytest.mark.parametrize(
    ("make", "allowed"),
    [
        (lambda: FailureModel((0.1, -0.1)), "0, or from 1e-12"),
        (lambda: FailureModel((0.1, 1.0)), "below 1"),
        (lambda: FailureModel((0.1, float("nan"))), "below 1"),
        (lambda: FailureModel((0.1, True)), "below 1"),
        (lambda: FailureModel((0.1, "0.1")), "below 1"),
        (lambda: FailureModel((0.0, 0.0)), "that may fail, 0"),
        (lambda: FailureModel((0.1, 0.0), 2), "that may fail, 1"),
        (lambda: FailureModel((0.1, 0.1), 0), "at least 1"),
        (lambda: FailureModel((0.1, 0.1)).sparing([2]), "at most 1"),
        (lambda: FailureModel((0.1, 0.1)).sparing([-1]), "at least 0"),
    ],
)
def test_refuses_what_cannot_be(make, allowed):
    with pytest.raises(InputError, match=allowed):
        make()
