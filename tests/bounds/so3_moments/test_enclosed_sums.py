from fractions import Fraction
from functools import partial
from itertools import permutations, product
from math import nextafter, sqrt

import numpy as np
import pytest

from formulations.bounds import closed_form
from formulations.bounds.closed_form import largest_residual
from formulations.bounds.so3_moments import enclosed_sums
from formulations.bounds.so3_moments.enclosed_sums import (
    enclosed_powers,
    enclosed_residuals,
    enclosed_scaled,
    enclosed_sum,
    krylov_forms,
)
from formulations.bounds.so3_moments.invariants import invariant_functions, invariant_values
from formulations.bounds.so3_moments.relaxation import residual_values
from formulations.bounds.so3_moments.sampled_blocks import (
    RowBlocks,
    krylov_form,
    residual_distance,
)
from formulations.bounds.so3_moments.verification import degree_of
from formulations.bounds.so3_moments.wigner import RowSector, jacobians_of, random_rotations
from tests.bounds.so3_moments import plain_average as plain

LIMIT = 0.3


def extended(seed, count, joints):
    return random_rotations(np.random.default_rng(seed), count, joints, extended=True)


def exact_jacobian(seed, joints):
    """Return the six rows of J at the first configuration of `extended`."""
    rows: list[list[Fraction]] = [[] for _ in range(6)]
    for q in np.random.default_rng(seed).standard_normal((1, joints, 4))[0]:
        w, x, y, z = map(Fraction, q.tolist())
        norm = w * w + x * x + y * y + z * z
        v = (w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y))
        omega = (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x))
        for row, entry in zip(rows, (*v, *omega), strict=True):
            row.append(entry / norm)
    return rows


def dot(first, second):
    return sum((a * b for a, b in zip(first, second, strict=True)), Fraction(0))


def exact_form(rows, locked):
    """Return H = Vᵀ(J_f J_fᵀ − tI)V."""
    columns = [list(column) for column in zip(*rows, strict=True)]
    vectors = [columns[locked]]
    for _ in range(2):
        turned = [dot(column, vectors[-1]) * Fraction(3, len(columns)) for column in columns]
        vectors.append([dot(row, turned) for row in rows])
    kept = [column for joint, column in enumerate(columns) if joint != locked]
    return [
        [
            (sum(dot(j, a) * dot(j, b) for j in kept) - Fraction(LIMIT) * dot(a, b)) / 2
            for b in vectors
        ]
        for a in vectors
    ]


def exactly(number):
    """Return a number in extended precision as a fraction."""
    return Fraction(float(number)) + Fraction(float(number - float(number)))


def test_forms_of_krylov_vectors_are_enclosed_at_an_exact_jacobian():
    exact = exact_form(exact_jacobian(3, 7), 2)
    (form,), (error,) = krylov_forms(jacobians_of(extended(3, 1, 7)), 2, LIMIT)
    square = sum((exactly(form[k, m]) - exact[k][m]) ** 2 for k in range(3) for m in range(3))
    assert 1e-4 * error < sqrt(square) < error < 1e-13


def test_a_sum_is_enclosed_at_an_exact_jacobian():
    """Vectors without polynomials: the mean of ⟨H_f, LLᵀ⟩ over the locked joints."""
    family = RowBlocks(RowSector(0, 0, 0, 4, 0), 4, krylov_form(LIMIT))
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
    squares = [
        [dot(*map(fractions, pair)) for pair in product([row], values)] for row in values
    ]
    rows = exact_jacobian(3, 4)
    forms = [exact_form(rows, locked) for locked in range(4)]
    exact = sum(
        (form[k][m] * squares[k][m] for form in forms for k in range(3) for m in range(3)),
        Fraction(0),
    )
    assert abs(Fraction(found.values[0]) - exact / 4) < found.errors[0]
    assert found.errors[0] < 1e-13 * found.sizes[0]
    assert abs(found.values[0]) > 0.01


def enclosed(family, roots):
    together = zip(family.blocks, roots, strict=True)
    return [enclosed_powers(family, block, root) for block, root in together]


def fractions(row):
    return [Fraction(x) for x in row.tolist()]


@pytest.mark.parametrize("seed", range(4))
def test_the_residual_is_enclosed_at_an_exact_jacobian(seed):
    rotations, rows = extended(seed, 1, 7), exact_jacobian(seed, 7)
    shift = Fraction(7, 3)
    exact = sum(
        (dot(a, b) - (shift if i == k else 0)) ** 2
        for i, a in enumerate(rows)
        for k, b in enumerate(rows)
    )
    found = enclosed_residuals(rotations)
    (value,), (error,) = found.values, found.errors
    assert abs(Fraction(value) - exact / 2) < error < 1e-14 * value
    assert abs(exactly(residual_values(rotations)[0]) - exact / 2) < error


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
    good = closed_form._largest_spread(count, mean, limit)
    assert count / (mean + (6 - count) * good) + (6 - count) / (mean - count * good) > limit
    monkeypatch.setattr(closed_form, "float", lambda x: 0.9 * x, raising=False)
    assert closed_form._largest_spread(count, mean, limit) > good * (1 - Fraction(1, 10**9))


DISTANCE = partial(residual_distance, 0.1, 8.0)
KINDS = {
    "plain": lambda: RowBlocks(RowSector(2, 0, 1, 4), 4),
    "scaled": lambda: RowBlocks(RowSector(2, 0, 1, 4), 4, factor=DISTANCE),
    "krylov": lambda: RowBlocks(RowSector(0, 0, 0, 4, 0), 4, krylov_form(LIMIT)),
    "krylov, odd joints": lambda: RowBlocks(RowSector(2, 0, 1, 4, 0), 4, krylov_form(LIMIT)),
    "krylov, odd locked joint": lambda: RowBlocks(
        RowSector(1, 2, 1, 4, 1), 4, krylov_form(LIMIT)
    ),
}


@pytest.fixture(params=KINDS.values(), ids=KINDS)
def family(request):
    """Return blocks that a test may change."""
    return request.param()


def random_roots(family, seed):
    rng = np.random.default_rng(seed)
    return [rng.standard_normal((size, size)) for size in family.sizes]


def enclosed_condition(family, roots, rotations):
    """Return Σ ⟨LLᵀ, B(x)⟩ over the blocks of plain, scaled or Krylov rows."""
    inner = enclosed_sum(family, enclosed(family, roots), rotations)
    return enclosed_scaled(*DISTANCE.args, inner, rotations) if family.factor else inner


def test_sums_are_enclosed(family):
    rotations, roots = extended(4, 2, 4), random_roots(family, 5)
    found = enclosed_condition(family, roots, rotations)
    multipliers = [root @ root.T for root in roots]
    other = plain.plain_condition_sum(family, rotations.astype(float), multipliers)
    # The second way is in double precision, without bounds.
    assert np.all(np.abs(found.values - other) < found.errors + 1e-13 * found.sizes)
    assert np.all(found.errors < 1e-10 * found.sizes)
    assert np.all(np.abs(found.values) <= found.sizes * (1 + 1e-9))


def krylov(degree):
    """Return a localiser and random roots; of degree 2 it has one power of M only."""
    family = RowBlocks(RowSector(1, 0, 0, degree, 1), 4, krylov_form(LIMIT))
    rng = np.random.default_rng(6)
    return family, [rng.standard_normal((size, 2)) for size in family.sizes]


def shifted_rows(patch, amount):
    """Rows that are off by a known amount, in the direction that matters most."""
    values, error = enclosed_sums.block_values, enclosed_sums.product_error

    def shifted(*arguments):
        found = values(*arguments)
        lengths = np.sqrt(np.sum(found**2, axis=(0, 2)))
        return found + amount * found / lengths[:, None]

    def larger(*arguments):
        fixed, relative = error(*arguments)
        return fixed + abs(amount), relative

    patch.setattr(enclosed_sums, "block_values", shifted)
    patch.setattr(enclosed_sums, "product_error", larger)


def shifted_forms(patch, amount):
    forms = enclosed_sums.krylov_forms

    def shifted(*arguments):
        found, errors = forms(*arguments)
        return found + amount * np.eye(3), errors + amount * sqrt(3)

    patch.setattr(enclosed_sums, "krylov_forms", shifted)


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
    found = enclosed_condition(family, random_roots(family, 9), everywhere)
    distance = np.abs(found.values - found.values.mean())
    assert distance.max() > 1e-7 * found.sizes.max()
    assert np.all(distance <= found.errors)


PLAIN, LOCKED = RowSector(2, 0, 0, 2), RowSector(0, 0, 0, 2, 0)


@pytest.mark.parametrize(
    ("family", "degree"),
    [
        (RowBlocks(PLAIN, 4), degree_of([PLAIN])),
        (RowBlocks(PLAIN, 4, factor=DISTANCE), degree_of([], [PLAIN])),
        (RowBlocks(LOCKED, 4, krylov_form(LIMIT)), degree_of([], [], [LOCKED])),
    ],
)
def test_entries_have_the_degree_that_the_proof_assumes(family, degree):
    """They are combinations of the invariants of that degree, and of no smaller one."""
    rotations = random_rotations(np.random.default_rng(12), 150, 4)
    entries = np.hstack([block.reshape(150, -1) for block in family.evaluate(rotations)])

    def leftover(degree):
        basis = invariant_values(invariant_functions(4, degree), rotations, degree)
        assert basis.shape[1] < 100
        return float(np.abs(entries - basis @ np.linalg.lstsq(basis, entries)[0]).max())

    assert leftover(degree) < 1e-10
    assert leftover(degree - 2) > 1e-3
