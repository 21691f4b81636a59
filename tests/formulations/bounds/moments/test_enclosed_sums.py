from fractions import Fraction
from functools import cache
from itertools import permutations
from math import nextafter, sqrt

import numpy as np
import pytest

from lockedjoint.formulations.bounds import revolute_exclusions
from lockedjoint.formulations.bounds.moments import enclosed_sums
from lockedjoint.formulations.bounds.moments.conditions import (
    WorstCaseCondition,
    deviation_form,
    gram_form,
    krylov_form,
    nearness,
    residual,
    residual_distance,
    spectral_distance,
)
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.moments.enclosed_squares import (
    EnclosedBlock,
    enclosed_block,
)
from lockedjoint.formulations.bounds.moments.enclosed_sums import enclosed_sum
from lockedjoint.formulations.bounds.moments.invariants import (
    invariant_functions,
    invariant_values,
)
from lockedjoint.formulations.bounds.moments.rotations import random_rotations
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.verification import degrees_of
from lockedjoint.formulations.bounds.revolute_exclusions import largest_residual
from tests.formulations.bounds.moments import plain_average as plain

LIMIT = 0.3


def extended(seed, count, joints):
    return random_rotations(np.random.default_rng(seed), count, joints, extended=True)


T = Fraction(LIMIT)
SHARE = Fraction(0.01)
UNIT = Fraction(0.6)


def exact_jacobian(seed, joints):
    """Return J at the first configuration of `extended`, in fractions."""
    columns = []
    for q in np.random.default_rng(seed).standard_normal((1, joints, 4))[0]:
        w, x, y, z = map(Fraction, q.tolist())
        norm = w * w + x * x + y * y + z * z
        v = (w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y))
        omega = (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x))
        columns.append([entry / norm for entry in (*v, *omega)])
    return np.array(columns).T


def exact_krylov(jacobian, locked):
    """Return H = Vᵀ(J_f J_fᵀ − tI)V."""
    vectors = jacobian[:, [locked]]
    for _ in range(2):
        turned = Fraction(3, jacobian.shape[1]) * (jacobian.T @ vectors[:, -1:])
        vectors = np.hstack([vectors, jacobian @ turned])
    images = vectors.T @ np.delete(jacobian, locked, axis=1)
    return (images @ images.T - T * (vectors.T @ vectors)) / 2


def exact_gram(jacobian, locked):
    """Return the form on J_fᵀj_f √2 and J_fᵀs 0.6 alone: without irrational numbers."""
    kept = np.delete(jacobian, locked, axis=1)
    vectors = np.array([jacobian[:, locked], jacobian.sum(axis=1) / UNIT]) @ kept
    images = vectors @ kept.T
    return images @ images.T - T * (vectors @ vectors.T)


def exact_deviation(jacobian, _):
    """Return the form on s and M s alone."""
    total = jacobian.sum(axis=1) / UNIT
    turned = Fraction(3, jacobian.shape[1]) * (jacobian.T @ total)
    vectors = np.array([total, jacobian @ turned])
    images, along = vectors @ jacobian, vectors @ total
    return SHARE / UNIT**2 * (images @ images.T) - np.outer(along, along)


def exact_defect(jacobian):
    return jacobian @ jacobian.T - Fraction(7, 3) * np.eye(6, dtype=int)


def exact_residual(jacobian, _):
    return np.sum(exact_defect(jacobian) ** 2, keepdims=True) / 2


def exact_spectral(jacobian, _):
    defect = exact_defect(jacobian)
    cubic = Fraction(0.2) * np.trace(defect @ defect @ defect)
    return Fraction(0.25) + cubic - exact_residual(jacobian, _)


def exact_nearness(jacobian, _):
    return (Fraction(0.01) - np.sum(jacobian.sum(axis=1) ** 2, keepdims=True)) / 2


RESIDUAL = WorstCaseCondition("residual", lambda j, _: residual(j))
# A condition, the vectors of it that have exact values, with which factors, and these values.
EXACT = [
    (krylov_form(LIMIT), [0, 1, 2], [1, 1, 1], exact_krylov),
    (gram_form(LIMIT), [1, 2], [sqrt(2), 1], exact_gram),
    (deviation_form(0.01), [1, 3], [1, 1], exact_deviation),
    (RESIDUAL, [0], [1], exact_residual),
    (spectral_distance(0.25), [0], [1], exact_spectral),
    (nearness(0.01), [0], [1], exact_nearness),
]


def exactly(number):
    """Return a number in extended precision as a fraction."""
    return Fraction(float(number)) + Fraction(float(number - float(number)))


@pytest.mark.parametrize(("condition", "chosen", "factors", "exact"), EXACT)
@pytest.mark.parametrize("seed", range(3))
def test_conditions_are_enclosed_at_an_exact_jacobian(condition, chosen, factors, exact, seed):
    jacobian = EnclosedMatrix.jacobian(extended(seed, 1, 7))
    found = condition.values(jacobian, 2)
    values = found.values[0][np.ix_(chosen, chosen)]
    values = values * np.outer(factors, factors).astype(np.longdouble)
    known, error = exact(exact_jacobian(seed, 7), 2), float(found.errors[0])
    square = sum((exactly(x) - y) ** 2 for x, y in zip(values.flat, known.flat, strict=True))
    allowed = error * max(factors) ** 2 + 1e-15 * (max(factors) > 1)
    assert 1e-6 * error < sqrt(square) < allowed
    assert error < 1e-13 * max(1, float(np.abs(found.values).max()))


def test_a_sum_is_enclosed_at_an_exact_jacobian():
    """Vectors without polynomials: the mean of ⟨H_f, LLᵀ⟩ over the locked joints."""
    family = BlockFamily(RowSector(0, 0, 0, 4, 0), 4, krylov_form(LIMIT))
    constant = next(n for n, rows in enumerate(family.rows) if not rows.labels)
    roots = [np.zeros((size, 2)) for size in family.sizes]
    values = np.array([[1.0, 0.3], [-1.1, 0.7], [0.2, 0.9]])
    for block, (chosen, powers), root in zip(
        family.blocks, family.selections, roots, strict=True
    ):
        for number, place, _ in block.parts:
            if number == constant:
                here = chosen == place.start
                root[here] = values[powers[here]]
    found = enclosed_sum(family, enclosed(family, roots), extended(3, 1, 4))
    exactly_so = np.array([[Fraction(x) for x in row] for row in values.tolist()])
    jacobian, squares = exact_jacobian(3, 4), exactly_so @ exactly_so.T
    exact = sum(np.sum(exact_krylov(jacobian, locked) * squares) for locked in range(4))
    assert abs(Fraction(found.values[0]) - exact / 4) < found.errors[0]
    assert found.errors[0] < 1e-13 * found.sizes[0]
    assert abs(found.values[0]) > 0.01


def enclosed(family, roots):
    together = zip(family.blocks, roots, strict=True)
    return [enclosed_block(family, block, root) for block, root in together]


@pytest.mark.parametrize("t", [0.32, 0.3279, 0.3284, nextafter(1 / 3, 0), 1 / 3 - 1e-9])
def test_the_limit_of_the_residual_is_above_all_spectra_that_t_allows(t):
    """One large eigenvalue and five equal ones: the condition in rational arithmetic."""
    bound, mean = largest_residual(7, t), Fraction(7, 3) - Fraction(t)

    def allowed(residual):
        y = Fraction(sqrt(residual / 15))
        return 1 / (mean + 5 * y) + 5 / (mean - y) <= 1 / Fraction(t)

    assert not allowed(Fraction(bound))
    if bound > 1e-9:
        assert allowed(Fraction(bound) * (1 - Fraction(1, 10**9)))


@pytest.mark.parametrize("count", range(1, 6))
def test_a_wrong_bisection_is_noticed(count, monkeypatch):
    """What is returned is what rational arithmetic confirms, wherever the bisection ends."""
    mean, limit = Fraction(7, 3) - Fraction(0.32), 1 / Fraction(0.32)
    good = revolute_exclusions._largest_spread(count, mean, limit)
    assert count / (mean + (6 - count) * good) + (6 - count) / (mean - count * good) > limit
    monkeypatch.setattr(revolute_exclusions, "float", lambda x: 0.9 * x, raising=False)
    assert revolute_exclusions._largest_spread(count, mean, limit) > good * (
        1 - Fraction(1, 10**9)
    )


# Sectors, conditions, and the conditions in a second way.
KINDS = {
    "plain": ((2, 0, 1, 4), None, None),
    "scaled": ((2, 0, 1, 4), residual_distance("scaled", 0.1, 8.0), plain.scaled(0.1, 8.0)),
    "krylov": ((0, 0, 0, 4, 0), krylov_form(LIMIT), plain.krylov(LIMIT)),
    "krylov, odd joints": ((2, 0, 1, 4, 0), krylov_form(LIMIT), plain.krylov(LIMIT)),
    "krylov, odd locked joint": ((1, 2, 1, 4, 1), krylov_form(LIMIT), plain.krylov(LIMIT)),
    "spectral": ((1, 1, 1, 3), spectral_distance(0.2), plain.spectral(0.2)),
    "unsigned": ((None, 0, 1, 2), None, None),
    "near": ((None, 1, 1, 3), nearness(9.0), plain.near(9.0)),
    "gram": ((None, 1, 1, 3, 0), gram_form(LIMIT), plain.gram(LIMIT)),
    "deviation": ((None, 2, 1, 2, 0), deviation_form(0.1), plain.deviation(0.1)),
}


@pytest.fixture(params=KINDS.values(), ids=KINDS)
def family(request):
    """Return blocks that a test may change."""
    sector, condition, _ = request.param
    return BlockFamily(RowSector(*sector), 4, condition)


def random_roots(family, seed):
    rng = np.random.default_rng(seed)
    return [rng.standard_normal((size, size)) for size in family.sizes]


def test_sums_are_enclosed(family, request):
    rotations, roots = extended(4, 2, 4), random_roots(family, 5)
    found = enclosed_sum(family, enclosed(family, roots), rotations)
    multipliers = [root @ root.T for root in roots]
    form = request.node.callspec.params["family"][2]
    other = plain.plain_condition_sum(family, rotations.astype(float), multipliers, form)
    # The second way is in double precision, without bounds.
    assert np.all(np.abs(found.values - other) < found.errors + 1e-13 * found.sizes)
    assert np.all(found.errors < 1e-10 * found.sizes)
    assert np.all(np.abs(found.values) <= found.sizes * (1 + 1e-9))


def krylov(degree):
    """Return a localiser and random roots; of degree 2 it has one power of M only."""
    family = BlockFamily(RowSector(1, 0, 0, degree, 1), 4, krylov_form(LIMIT))
    rng = np.random.default_rng(6)
    return family, [rng.standard_normal((size, 2)) for size in family.sizes]


def shifted_rows(patch, amount):
    """Rows that are off by a known amount, in the direction that matters most."""
    values, error = enclosed_sums.block_values, EnclosedBlock.mistakes

    def shifted(*arguments):
        found = values(*arguments)
        lengths = np.sqrt(np.sum(found**2, axis=(1, 2), keepdims=True))
        return found + amount * found / lengths

    def larger(*arguments):
        return error(*arguments) + abs(amount)

    patch.setattr(enclosed_sums, "block_values", shifted)
    patch.setattr(EnclosedBlock, "mistakes", larger)


def shifted_forms(patch, amount):
    form = enclosed_sums._condition_matrix

    def shifted(*arguments):
        exact = form(*arguments)
        errors = exact.errors + amount * sqrt(3)
        return EnclosedMatrix(exact.values + amount * np.eye(3), errors)

    patch.setattr(enclosed_sums, "_condition_matrix", shifted)


@pytest.mark.parametrize(
    ("shift", "amount"),
    [*((shifted_rows, x) for x in (1e-3, -1e-3, 30.0, -30.0)), (shifted_forms, 1e-3)],
)
@pytest.mark.parametrize("degree", [2, 4])
def test_errors_of_the_rows_and_of_the_forms_are_covered(shift, amount, degree, monkeypatch):
    family, roots = krylov(degree)
    rotations = extended(7, 3, 4)
    good = enclosed_sum(family, enclosed(family, roots), rotations)
    shift(monkeypatch, amount)
    wrong = enclosed_sum(family, enclosed(family, roots), rotations)
    distance = np.abs(wrong.values - good.values)
    assert np.all(distance > 1e3 * good.errors)
    assert np.all(distance <= wrong.errors)


def test_the_distance_from_the_average_over_orders_is_covered(family):
    """Rows that are not symmetric: their average over all orders of the joints is meant."""
    (rotations,) = extended(8, 1, 4)
    for block in family.blocks:
        for _, _, coefficients in block.parts:
            coefficients[0, 0] += 1e-3
    everywhere = rotations[list(permutations(range(4)))]
    found = enclosed_sum(family, enclosed(family, random_roots(family, 9)), everywhere)
    distance = np.abs(found.values - found.values.mean())
    assert distance.max() > 1e-7 * found.sizes.max()
    assert np.all(distance <= found.errors)


MANY = random_rotations(np.random.default_rng(12), 700, 4)


@cache
def invariants_at_many(*degrees):
    """Orthonormal combinations of all invariants of these degrees, at `MANY`."""
    basis = invariant_values(invariant_functions(4, *degrees), MANY, max(degrees))
    assert basis.shape[1] < 650
    return np.linalg.qr(basis)[0]


@pytest.mark.parametrize(("sector", "condition", "_"), KINDS.values(), ids=KINDS)
def test_entries_have_the_degree_that_the_proof_assumes(sector, condition, _):
    """They are combinations of the invariants of that degree, and of no smaller one."""
    family = BlockFamily(RowSector(*sector), 4, condition)
    signed, unsigned = degrees_of({family.name: [family.sector]})
    entries = np.hstack([block.reshape(len(MANY), -1) for block in family.evaluate(MANY)])

    def leftover(*degrees):
        basis = invariants_at_many(*degrees)
        return float(np.abs(entries - basis @ (basis.T @ entries)).max())

    assert leftover(signed, unsigned) < 1e-9
    assert leftover(*((4, unsigned - 2) if unsigned else (signed - 2, 0))) > 1e-4
