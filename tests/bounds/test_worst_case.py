"""The facts about a class of Jacobians hold for its members."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.bounds.closed_form import block_trace_bound
from formulations.bounds.worst_case.problem import free_columns, revolute_arm


def test_lever_arms_enter_squared() -> None:
    arm = revolute_arm(7, lever_arm=2.0)
    assert arm.trace == 7 + 28
    assert arm.closed_form == block_trace_bound(7, (3, 3), (28, 7))
    assert [fact.value for fact in arm.facts] == [7, 28, 0]
    assert free_columns(7, 6).trace == 6


@given(st.integers(7, 12), st.floats(0.1, 10.0), st.integers(0, 2**32 - 1))
def test_random_arms_obey_the_facts_and_the_bound(n: int, lever_arm: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = np.linalg.qr(rng.standard_normal((n, 3, 2)))[0]
    lengths = lever_arm * rng.uniform(0.5, 1.0, size=n)
    jacobian = np.concatenate([frames[:, :, 0].T * lengths, frames[:, :, 1].T])
    gram = jacobian @ jacobian.T
    problem = revolute_arm(n, lever_arm=lever_arm)
    assert np.trace(gram) <= problem.trace * (1 + 1e-12)
    for fact in problem.facts:
        value = float(np.sum(fact.matrix * gram))
        if fact.relation == "equal":
            assert value == pytest.approx(fact.value, abs=1e-9)
        else:
            assert value <= fact.value * (1 + 1e-12)
    worst = min(np.linalg.eigvalsh(gram - np.outer(j, j))[0] for j in jacobian.T)
    assert problem.closed_form is not None
    assert worst <= problem.closed_form * (1 + 1e-12)
