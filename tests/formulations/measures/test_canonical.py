"""One representative per class: every symmetry leaves it, everything else changes it.

And classes by `invariants` are those of the representatives.
"""

from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures import canonical
from lockedjoint.formulations.measures.canonical import (
    Symmetry,
    canonical_form,
    classes,
    count_symmetries,
    group_equivalent,
    inner_products,
    invariants,
    symmetry_of,
)

ARMS = {
    Symmetry.UNIT_REVOLUTE: arm("unit-revolute", 7),
    Symmetry.REVOLUTE: arm("lever-revolute", 7),
    Symmetry.FRAME: arm("free", 5, 3),
}
seeds = st.integers(0, 100_000)
symmetries = st.sampled_from(list(ARMS))


def draw(symmetry, seed):
    return drawn(ARMS[symmetry], np.random.default_rng(seed))


def drawn(model, rng):
    return model.jacobian(model.sample(rng))


def orthogonal(rng, size):
    return np.linalg.qr(rng.normal(size=(size, size)))[0]


def phase(jacobian, theta):
    c, s = np.cos(theta), np.sin(theta)
    velocity, axis = jacobian[:3], jacobian[3:]
    return np.vstack([c * velocity - s * axis, s * velocity + c * axis])


def disguised(jacobian, symmetry, rng):
    """The same manipulator Jacobian in other clothes."""
    m, n = jacobian.shape
    if symmetry is Symmetry.FRAME:
        jacobian = orthogonal(rng, m) @ jacobian
    else:
        if symmetry is Symmetry.UNIT_REVOLUTE:
            jacobian = phase(jacobian, rng.uniform(0, 7))
        if rng.uniform() < 0.5:
            jacobian = np.vstack([jacobian[:3], -jacobian[3:]])
        jacobian = np.kron(np.eye(2), orthogonal(rng, 3)) @ jacobian
    return (jacobian * rng.choice([-1, 1], n))[:, rng.permutation(n)]


@given(symmetries, seeds)
def test_the_symmetry_is_seen_from_the_columns(symmetry, seed):
    assert symmetry_of(draw(symmetry, seed)) is symmetry


@given(symmetries, seeds)
def test_every_symmetry_leaves_the_canonical_form(symmetry, seed):
    jacobian = draw(symmetry, seed)
    other = disguised(jacobian, symmetry, np.random.default_rng(seed + 1))
    np.testing.assert_allclose(canonical_form(other), canonical_form(jacobian), atol=1e-9)


@given(symmetries, seeds)
def test_the_canonical_form_is_its_own_and_of_the_same_class(symmetry, seed):
    jacobian = draw(symmetry, seed)
    form = canonical_form(jacobian)
    np.testing.assert_allclose(canonical_form(form), form, atol=1e-9)
    np.testing.assert_allclose(np.linalg.svd(form)[1], np.linalg.svd(jacobian)[1], atol=1e-9)
    assert group_equivalent([form, jacobian]) == [[0, 1]]


@given(symmetries, seeds)
def test_other_jacobians_have_other_forms(symmetry, seed):
    pair = [draw(symmetry, seed), draw(symmetry, seed + 1)]
    assert np.max(np.abs(canonical_form(pair[0]) - canonical_form(pair[1]))) > 1e-2
    assert group_equivalent(pair) == [[0], [1]]


def test_the_phase_is_no_symmetry_of_free_lever_arms():
    jacobian = draw(Symmetry.UNIT_REVOLUTE, 5)
    turned = phase(jacobian, 0.4)
    assert group_equivalent([jacobian, turned]) == [[0, 1]]
    assert group_equivalent([jacobian, turned], symmetry=Symmetry.REVOLUTE) == [[0], [1]]


def test_highly_symmetric_jacobians_are_handled():
    """All orders of a regular simplex are equivalent: 13! ties must not be walked through."""
    centred = np.eye(13) - 1 / 13
    simplex = np.linalg.svd(centred)[2][:12]
    rng = np.random.default_rng(0)
    other = disguised(simplex, Symmetry.FRAME, rng)
    assert group_equivalent([simplex, other]) == [[0, 1]]


# Prismatic joints among them: not all numbers of a column are those of a lever arm.
MIXED = {**ARMS, Symmetry.REVOLUTE: arm("lever-revolute:5,prismatic:2", 7)}


@pytest.mark.parametrize("symmetry", Symmetry)
@given(seed=st.integers(0, 10**6))
def test_no_symmetry_changes_the_invariants(symmetry, seed):
    rng = np.random.default_rng(seed)
    jacobian = drawn(MIXED[symmetry], rng)
    other = disguised(jacobian, symmetry, rng)
    one, two = invariants(jacobian, symmetry), invariants(other, symmetry)
    np.testing.assert_allclose(one, two, atol=1e-12)


@pytest.mark.parametrize("symmetry", Symmetry)
@given(seed=st.integers(0, 10**6), size=st.floats(1e-6, 1e-2))
def test_invariants_move_little_more_than_inner_products(symmetry, seed, size):
    """So Jacobians with other invariants are others, whatever the order of their joints."""
    rng = np.random.default_rng(seed)
    jacobian = drawn(MIXED[symmetry], rng)
    other = jacobian + size * rng.normal(size=jacobian.shape)
    moves = np.abs(inner_products(jacobian, symmetry) - inner_products(other, symmetry)).max()
    away = np.abs(invariants(jacobian, symmetry) - invariants(other, symmetry)).max()
    assert away <= 5 / 3 * moves * (1 + 1e-9)


@pytest.mark.parametrize("symmetry", Symmetry)
def test_classes_are_those_of_the_canonical_form(symmetry):
    rng = np.random.default_rng(5)
    kinds = [drawn(MIXED[symmetry], rng) for _ in range(4)]
    kinds.append(kinds[0].copy())
    kinds[-1][:, 2] *= 1.01  # near the first, and not it
    chosen = [kinds[k] for k in (0, 1, 0, 2, 4, 0, 3, 4, 1)]
    shown = [disguised(jacobian, symmetry, rng) for jacobian in chosen]
    found = sorted(classes(shown, symmetry), key=len, reverse=True)
    assert found == [[0, 2, 5], [1, 8], [4, 7], [3], [6]]
    assert sorted(group_equivalent(shown, canonical.TOLERANCE, symmetry)) == sorted(found)


def test_signs_that_cannot_be_switched_away_make_another_class():
    """Same moduli of all inner products, but the product around a triangle is negative."""
    gram = np.full((3, 3), 0.25) + 0.75 * np.eye(3)
    other = gram.copy()
    other[0, 1] = other[1, 0] = -0.25
    pair = [np.linalg.cholesky(matrix).T for matrix in (gram, other)]
    assert classes(pair, Symmetry.FRAME) == [[0], [1]]


@pytest.mark.parametrize(
    "columns", [[0, 60, 120], [0, 45, 90, 135], [0, 0, 90, 90], [0, 10, 35]]
)
def test_symmetries_are_those_of_all_orders_and_signs(columns):
    angles = np.deg2rad(columns)
    jacobian = np.array([np.cos(angles), np.sin(angles)])
    gram, n = jacobian.T @ jacobian, len(columns)
    both = product(permutations(range(n)), product((1.0, -1.0), repeat=n))
    images = (gram[np.ix_(order, order)] * np.outer(signs, signs) for order, signs in both)
    assert 2 * count_symmetries(jacobian) == sum(np.allclose(one, gram) for one in images)


def test_too_many_symmetries_are_not_counted():
    assert count_symmetries(np.ones((2, 5))) == 120
    assert count_symmetries(np.ones((2, 7))) is None  # of 5040


@given(symmetries, seeds)
def test_symmetries_are_those_of_the_class(symmetry, seed):
    jacobian = draw(symmetry, seed)
    assert count_symmetries(jacobian) == 1
    twice = np.hstack([jacobian, jacobian[:, :2]])
    other = disguised(twice, symmetry, np.random.default_rng(seed))
    assert count_symmetries(other) == 4
