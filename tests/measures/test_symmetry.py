"""Classes are those of the canonical form, whatever symmetry has turned a Jacobian into."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.joints.models import arm
from formulations.measures import canonical as classes
from formulations.measures.canonical import Classes, Symmetry, group_equivalent, invariants

ARMS = {
    Symmetry.FRAME: arm("free", 5, 3),
    Symmetry.REVOLUTE: arm("lever-revolute:5,prismatic:2", 7),
    Symmetry.UNIT_REVOLUTE: arm("unit-revolute", 7),
}


def rotation(rng, size):
    q, _ = np.linalg.qr(rng.normal(size=(size, size)))
    return q * np.sign(np.linalg.det(q))


def moved(jacobian, symmetry, rng):
    """The same manipulator in another frame, order, signs, phase and mirror image."""
    m, n = jacobian.shape
    if symmetry is Symmetry.FRAME:
        turned = rotation(rng, m) @ jacobian
    else:
        frame = rotation(rng, 3)
        v, w = frame @ jacobian[:3], frame @ jacobian[3:]
        if symmetry is Symmetry.UNIT_REVOLUTE:
            phase = rng.uniform(0, 7)
            v, w = (
                np.cos(phase) * v - np.sin(phase) * w,
                np.sin(phase) * v + np.cos(phase) * w,
            )
        turned = np.vstack([v, rng.choice([-1, 1]) * w])
    return turned[:, rng.permutation(n)] * rng.choice([-1.0, 1.0], n)


@pytest.mark.parametrize("symmetry", Symmetry)
@given(seed=st.integers(0, 10**6))
def test_no_symmetry_changes_the_invariants(symmetry, seed):
    rng = np.random.default_rng(seed)
    jacobian = ARMS[symmetry].jacobian(ARMS[symmetry].sample(rng))
    other = moved(jacobian, symmetry, rng)
    one, two = invariants(jacobian, symmetry), invariants(other, symmetry)
    np.testing.assert_allclose(one, two, atol=1e-12)


@pytest.mark.parametrize("symmetry", Symmetry)
@given(seed=st.integers(0, 10**6), size=st.floats(1e-6, 1e-2))
def test_invariants_move_no_more_than_inner_products(symmetry, seed, size):
    """So Jacobians with other invariants are others, whatever the order of their joints."""
    from formulations.measures.canonical import inner_products

    rng = np.random.default_rng(seed)
    jacobian = ARMS[symmetry].jacobian(ARMS[symmetry].sample(rng))
    other = jacobian + size * rng.normal(size=jacobian.shape)
    moves = np.abs(inner_products(jacobian, symmetry) - inner_products(other, symmetry)).max()
    away = np.abs(invariants(jacobian, symmetry) - invariants(other, symmetry)).max()
    assert away <= moves * (1 + 1e-9)


@pytest.mark.parametrize("symmetry", Symmetry)
def test_classes_are_those_of_the_canonical_form(symmetry):
    rng = np.random.default_rng(5)
    built = ARMS[symmetry]
    kinds = [built.jacobian(built.sample(rng)) for _ in range(4)]
    kinds.append(kinds[0].copy())
    kinds[-1][:, 2] *= 1.01  # near the first, and not it
    chosen = [kinds[k] for k in (0, 1, 0, 2, 4, 0, 3, 4, 1)]
    shown = [moved(jacobian, symmetry, rng) for jacobian in chosen]
    found = Classes(symmetry)
    for score, jacobian in enumerate(shown):
        found.add(jacobian, score)
    reached = [one.reached for one in found.most_reached()]
    assert reached == [3, 2, 2, 1, 1]
    groups = group_equivalent(shown, classes.TOLERANCE, symmetry)
    assert sorted(map(len, groups), reverse=True) == reached
    assert [one.score for one in found.most_reached()] == [0, 1, 4, 3, 6]


def test_signs_that_cannot_be_switched_away_make_another_class():
    """Same moduli of all inner products, but the product around a triangle is negative."""
    gram = np.full((3, 3), 0.25) + 0.75 * np.eye(3)
    other = gram.copy()
    other[0, 1] = other[1, 0] = -0.25
    found = Classes(Symmetry.FRAME)
    for matrix in (gram, other):
        found.add(np.linalg.cholesky(matrix).T[:, :], 0.0)
    assert len(found.most_reached()) == 2


def test_only_so_many_are_distinguished(monkeypatch):
    monkeypatch.setattr(classes, "MOST", 3)
    rng, built = np.random.default_rng(1), ARMS[Symmetry.FRAME]
    found = Classes(Symmetry.FRAME)
    first = built.jacobian(built.sample(rng))
    for jacobian in (first, *(built.jacobian(built.sample(rng)) for _ in range(5)), first):
        found.add(jacobian, 0.0)
    assert [one.reached for one in found.most_reached()] == [2, 1, 1]
