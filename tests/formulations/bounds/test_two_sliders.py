"""Five revolute and two prismatic joints: the closed form, drawn arms and the best known."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lockedjoint as lj
from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.bounds.certified import largest_worst_case
from lockedjoint.formulations.bounds.two_sliders import (
    excludes_eigenvalue,
    has_two_sliders,
    two_sliders_bound,
)
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute

BEST = page_of(entry("unit-revolute-5+prismatic-2_6x7_k1"))


def drawn_arm(seed):
    """Return J near or far from the best known one, with columns of the model.

    Of arms that are drawn freely most have worst cases near 0, of which the bound says nothing.
    """
    rng = np.random.default_rng(seed)
    jacobian = BEST.jacobian + 10.0 ** rng.uniform(-3, 0) * rng.standard_normal((6, 7))
    jacobian[3:, 5:] = 0.0
    axes = jacobian[3:, :5] / np.linalg.norm(jacobian[3:, :5], axis=0)
    levers = jacobian[:3, :5] - axes * np.sum(jacobian[:3, :5] * axes, axis=0)
    jacobian[3:, :5], jacobian[:3, :5] = axes, levers
    jacobian[:3] /= np.linalg.norm(jacobian[:3], axis=0)
    return jacobian


@given(st.integers(0, 2**32 - 1))
def test_every_step_of_the_proof_holds_of_drawn_arms(seed):
    jacobian = drawn_arm(seed)
    sigma = lj.measures.worst_case_sigma(jacobian)
    assert sigma <= two_sliders_bound()
    t = (1 - 1e-9) * sigma**2
    gap = np.linalg.inv(jacobian @ jacobian.T - t * np.eye(6))
    taken = np.einsum("if,ij,jf->f", jacobian, gap, jacobian)
    assert taken.max() <= 1 + 1e-6
    sliders, trace = taken[5:].sum(), np.trace(gap)
    assert sliders - t * trace >= 1 - 1e-6
    a = 1 + abs(jacobian[:3, 5] @ jacobian[:3, 6])
    plane = np.linalg.qr(jacobian[:3, 5:])[0]
    block = plane.T @ gap[:3, :3] @ plane
    steep = (jacobian[:3, 5:].T @ plane).T @ (jacobian[:3, 5:].T @ plane) - t * np.eye(2)
    least = np.minimum(np.linalg.eigvals(block @ steep).real, 1).sum()
    rest = t / (7 - 3 * t - np.trace(np.linalg.inv(block))) + 9 * t / (5 - 3 * t)
    assert least - rest >= sliders - t * trace - 1e-6
    assert a < 2 - t
    left = (1 - t / (a - t)) * (1 - t / (2 - a))
    assert left >= t / (6 - 3 * t - a * (2 - a)) + 9 * t / (5 - 3 * t) - 1e-6


def test_the_bound_is_proved_and_no_much_smaller_one_is():
    bound = two_sliders_bound()
    assert excludes_eigenvalue(Fraction(bound) ** 2)
    assert not excludes_eigenvalue(Fraction(bound * (1 - 1e-5)) ** 2)
    assert not any(excludes_eigenvalue(Fraction(k, 100)) for k in range(24))
    assert float(BEST.value) < bound < 0.483
    assert largest_worst_case(BEST.entry.arm).value == bound


@pytest.mark.parametrize(
    ("revolute", "prismatic", "holds"),
    [
        (UnitRevolute(), Prismatic(), True),
        (LeverRevolute(0.5, "each"), Prismatic(), True),
        (LeverRevolute(1.5, "each"), Prismatic(), False),
        (LeverRevolute(1.0, "mean"), Prismatic(), False),
        (LeverRevolute(1.0, "each", 0.1), Prismatic(), False),
        (UnitRevolute(), Prismatic(0.5), False),
    ],
)
def test_it_is_used_for_arms_of_which_it_is_proved(revolute, prismatic, holds):
    assert has_two_sliders(Arm((revolute,) * 5 + (prismatic,) * 2)) is holds
    assert not has_two_sliders(Arm((revolute,) * 6 + (prismatic,)))
    assert not has_two_sliders(Arm((revolute,) * 6 + (prismatic,) * 2))
