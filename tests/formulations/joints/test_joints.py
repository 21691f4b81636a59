"""Column models: what they contribute, how they are drawn, and back from numbers."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import NotInModelError
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.formulations.joints.models import arm

KINDS = [UnitRevolute(), LeverRevolute(), LeverRevolute(length=0.3, budget="each")]
KINDS += [LeverRevolute(budget="each", pitch=-0.4), Prismatic(speed=2.0)]
KINDS += [FreeColumn(6, norm=1.5), FreeColumn(4, budget="mean")]
ARMS = [
    *(Arm.of(kind, kind.dimension + 2) for kind in KINDS),
    Arm((UnitRevolute(),) * 3 + (LeverRevolute(),) * 4 + (Prismatic(),) * 2),
]
seeds = st.integers(0, 2**32 - 1)


def draw(arm, seed):
    return arm.sample(np.random.default_rng(seed))


@pytest.mark.parametrize("arm", ARMS, ids=str)
@given(seed=seeds)
def test_from_variables_to_jacobian_and_back(arm, seed):
    """Variables are not unique (angles wrap, poles); the Jacobian they give is."""
    jacobian = arm.jacobian(draw(arm, seed))
    assert jacobian.shape == arm.shape
    np.testing.assert_allclose(arm.jacobian(arm.variables(jacobian)), jacobian, atol=1e-12)


@pytest.mark.parametrize("arm", ARMS, ids=str)
@given(seed=seeds)
def test_samples_satisfy_the_arm_s_constraints(arm, seed):
    symbols = arm.symbols()
    point = draw(arm, seed)
    for block in arm.constraints(symbols):
        value = np.array(ca.Function("g", [symbols], [block.expression])(point)).ravel()
        assert np.all(value >= np.asarray(block.lower) - 1e-12)
        assert np.all(value <= np.asarray(block.upper) + 1e-12)


@pytest.mark.parametrize("kind", KINDS, ids=str)
@given(seed=seeds)
def test_columns_satisfy_what_their_kind_says_of_jjᵀ(kind, seed):
    """A wrong condition or norm would make a bound wrong, and few Jacobians would show it."""
    one = Arm.of(kind, kind.dimension + 2)
    columns = one.jacobian(draw(one, seed)).T
    norms = np.sum(columns**2, axis=1)
    shared = getattr(kind, "budget", "each") == "mean"
    largest = norms.mean() if shared else norms.max()
    assert largest <= kind.largest_norm_squared + 1e-9
    for condition in kind.gram_conditions:
        values = np.einsum("ni,ij,nj->n", columns, np.array(condition.matrix), columns)
        values = values.mean(keepdims=True) if condition.shared else values
        assert np.all(values <= condition.limit + 1e-9), condition.name
        assert not condition.equal or np.all(values >= condition.limit - 1e-9), condition.name


def test_eq_21_as_printed():
    """Eq. (21) entry by entry, the zero that the scan lost restored."""
    alpha, beta, gamma = 0.3, -0.7, 1.9
    s, c = np.sin, np.cos
    expected = [
        c(gamma) * c(alpha) * s(beta) + s(gamma) * s(alpha),
        c(gamma) * s(alpha) * s(beta) - s(gamma) * c(alpha),
        -c(gamma) * c(beta),
        c(alpha) * c(beta),
        s(alpha) * c(beta),
        s(beta),
    ]
    column = UnitRevolute().column(ca.SX([alpha, beta, gamma]))
    np.testing.assert_allclose(np.array(ca.DM(column)).ravel(), expected)


def test_unit_revolute_samples_are_uniform_on_so3():
    """Uniform rotations have E[v vᵀ] = E[ω ωᵀ] = I/3, E[v ωᵀ] = 0, E[ω] = 0, E[v_z⁴] = 1/5."""
    arm = Arm.of(UnitRevolute(), 4000)
    jacobian = arm.jacobian(draw(arm, 0))
    error = 5 / np.sqrt(4000)
    np.testing.assert_allclose(jacobian @ jacobian.T / 4000, np.eye(6) / 3, atol=error / 2)
    np.testing.assert_allclose(jacobian.mean(axis=1), 0, atol=error)
    np.testing.assert_allclose(np.mean(jacobian**4, axis=1), 1 / 5, atol=error / 2)


@pytest.mark.parametrize(("budget", "mean_square"), [("each", 1 / 2), ("mean", 14 / 16)])
def test_lever_arms_are_uniform_in_their_ball(budget, mean_square):
    """Uniform in the unit disc: E|v|² = 1/2. Mean of 7 in a 14-ball: 14/16."""
    joint = LeverRevolute(budget=budget)
    draws = [joint.sample(np.random.default_rng(k), 7)[:, :3] for k in range(2000)]
    means = np.mean(np.sum(np.square(draws), axis=2), axis=1)
    assert means.max() <= 1 + 1e-12
    assert np.mean(means) == pytest.approx(mean_square, abs=0.01)


def column(*entries):
    return np.array(entries, dtype=float)


@pytest.mark.parametrize(
    ("joint", "bad"),
    [
        (UnitRevolute(), column(1, 0, 0, 0, 2, 0)),
        (UnitRevolute(), column(1, 0, 0, 1, 0, 0)),
        (UnitRevolute(), column(0.5, 0, 0, 0, 1, 0)),
        (LeverRevolute(), column(3, 0, 0, 0, 1.1, 0)),
        (LeverRevolute(), column(3, 1, 0, 0, 1, 0)),
        (LeverRevolute(pitch=0.5), column(3, 0.4, 0, 0, 1, 0)),
        (LeverRevolute(length=2, budget="each"), column(3, 0, 0, 0, 1, 0)),
        (Prismatic(), column(1, 0, 0, 0, 0, 0.1)),
        (Prismatic(), column(2, 0, 0, 0, 0, 0)),
        (FreeColumn(2), column(1, 1)),
    ],
)
def test_columns_outside_the_model_are_refused(joint, bad):
    with pytest.raises(NotInModelError, match=r"column is \(.*allowed: "):
        joint.invert(bad)


def test_a_shared_bound_is_checked_on_the_whole_arm():
    arm = Arm.of(LeverRevolute(length=1.0), 7)
    jacobian = arm.jacobian(draw(arm, 3))
    arm.variables(jacobian)
    with pytest.raises(NotInModelError, match="mean squared"):
        arm.variables(np.vstack([3 * jacobian[:3], jacobian[3:]]))


def test_largest_trace_is_attained_and_not_passed():
    mixed = Arm((UnitRevolute(),) * 3 + (LeverRevolute(2.0),) * 4 + (Prismatic(3.0),) * 2)
    assert mixed.largest_trace == pytest.approx(3 * 2 + 4 * (1 + 4) + 2 * 9)
    assert mixed.fixed_trace is None
    traces = [np.sum(mixed.jacobian(draw(mixed, k)) ** 2) for k in range(200)]
    assert max(traces) <= mixed.largest_trace + 1e-9
    assert max(traces) > 0.95 * mixed.largest_trace
    assert Arm.of(UnitRevolute(), 7).fixed_trace == 14


@given(seed=seeds)
def test_a_pitch_shears_all_columns_alike(seed):
    """A thruster at r with axis a: force a, moment r × a + ca, here below it."""
    rng = np.random.default_rng(seed)
    axis, place = rng.standard_normal((2, 3))
    axis, place = axis / np.linalg.norm(axis), place / np.linalg.norm(place)
    column = np.concatenate([np.cross(place, axis) + 0.05 * axis, axis])
    rotor = arm("rotor", 7).joints[0]
    parameters = rotor.invert(column)
    np.testing.assert_allclose(parameters[:3], np.cross(place, axis), atol=1e-12)
    with pytest.raises(NotInModelError):
        arm("counter-rotor", 7).joints[0].invert(column)
    assert rotor.largest_norm_squared == pytest.approx(2.0025)
    assert float(np.sum(column**2)) <= rotor.largest_norm_squared + 1e-12
