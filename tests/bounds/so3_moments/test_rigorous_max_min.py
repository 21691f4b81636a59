from __future__ import annotations

from fractions import Fraction
from itertools import permutations
from math import inf, nextafter, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from formulations.bounds.so3_moments import fixed_worst_case
from formulations.bounds.so3_moments import max_min_bound as max_min_module
from formulations.bounds.so3_moments.blocks import enclosed_localisers
from formulations.bounds.so3_moments.blocks.enclosed_localisers import (
    enclosed_krylov_sum,
    enclosed_product,
    krylov_forms,
)
from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, SectorBlocks
from formulations.bounds.so3_moments.fixed_worst_case import (
    Conditions,
    ResidualDistance,
    condition_families,
    largest_residual,
    solve_exclusion,
)
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.max_min_bound import CONDITIONS, max_min_bound
from formulations.bounds.so3_moments.programs.multipliers import refined_multipliers
from formulations.bounds.so3_moments.relaxation import residual_values
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from formulations.bounds.so3_moments.rigorous_max_min import (
    check_degrees,
    enclosed_condition,
    exclusion_defect,
)
from formulations.bounds.so3_moments.rigorous_residual import residual_error
from nlp.arrays import FloatArray
from nlp.errors import InputError

SMALL = Conditions(
    plain=tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
    scaled=(RowSector(0, 0, 0, 2), RowSector(2, 0, 0, 2)),
    krylov=(RowSector(0, 0, 0, 2, 0), RowSector(1, 0, 0, 2, 1)),
)
LIMIT = 0.3


def extended(seed: int, count: int, joints: int) -> FloatArray:
    return random_rotations(np.random.default_rng(seed), count, joints, extended=True)


def exact_jacobian(seed: int, joints: int) -> list[list[Fraction]]:
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


def dot(first: list[Fraction], second: list[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(first, second, strict=True)), Fraction(0))


@pytest.mark.parametrize("precise", [True, False])
def test_forms_of_krylov_vectors_are_enclosed_at_an_exact_jacobian(precise: bool) -> None:
    rotations, rows, locked = extended(3, 1, 7), exact_jacobian(3, 7), 2
    columns = [list(column) for column in zip(*rows, strict=True)]
    vectors = [columns[locked]]
    for _ in range(2):
        turned = [dot(column, vectors[-1]) * Fraction(3, 7) for column in columns]
        vectors.append([dot(row, turned) for row in rows])
    kept = [column for joint, column in enumerate(columns) if joint != locked]
    forms, errors = krylov_forms(
        jacobians_of(rotations if precise else rotations.astype(float)), locked, LIMIT
    )
    square = Fraction(0)
    for k, first in enumerate(vectors):
        for m, second in enumerate(vectors):
            exact = sum(dot(j, first) * dot(j, second) for j in kept)
            exact = (exact - Fraction(LIMIT) * dot(first, second)) / 2
            high, low = float(forms[0, k, m]), float(forms[0, k, m] - float(forms[0, k, m]))
            square += (Fraction(high) + Fraction(low) - exact) ** 2
    assert 1e-3 * errors[0] < sqrt(square) < errors[0]
    assert errors[0] < (1e-13 if precise else 1e-10)


def test_the_residual_is_enclosed_at_an_exact_jacobian() -> None:
    """n/3 has to be as precise as the rest."""
    rotations, rows = extended(3, 1, 7), exact_jacobian(3, 7)
    shift = Fraction(7, 3)
    exact = sum(
        (dot(a, b) - (shift if i == k else 0)) ** 2
        for i, a in enumerate(rows)
        for k, b in enumerate(rows)
    )
    found = residual_values(rotations)[0]
    high, low = float(found), float(found - float(found))
    assert abs(Fraction(high) + Fraction(low) - exact / 2) < residual_error(rotations)[0]


@pytest.mark.parametrize("t", [0.32, 0.3279, 0.3284, nextafter(1 / 3, 0), 1 / 3 - 1e-9])
def test_the_limit_of_the_residual_is_above_all_spectra_that_t_allows(t: float) -> None:
    """One large eigenvalue and five equal ones: the condition in rational arithmetic."""
    bound, mean = largest_residual(7, t), Fraction(7, 3) - Fraction(t)

    def allowed(residual: Fraction) -> bool:
        y = Fraction(sqrt(residual / 15))
        return 1 / (mean + 5 * y) + 5 / (mean - y) <= 1 / Fraction(t)

    assert not allowed(Fraction(bound))
    if bound > 1e-9:
        assert allowed(Fraction(bound) * (1 - Fraction(1, 10**9)))


def test_a_bisection_that_stops_too_early_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit is what rational arithmetic confirms, not what the bisection suggests."""
    good = largest_residual(7, 0.32)
    monkeypatch.setattr(fixed_worst_case, "float", lambda x: 0.9 * float(x), raising=False)
    assert largest_residual(7, 0.32) >= 0.99 * 0.9 * good
    monkeypatch.undo()
    spread = fixed_worst_case._largest_spread
    mean, limit = Fraction(7, 3) - Fraction(0.32), 1 / Fraction(0.32)
    y = spread(1, mean, limit)
    assert 1 / (mean + 5 * y) + 5 / (mean - y) > limit


FAMILIES = [
    SectorBlocks(RowSector(2, 0, 1, 3), 5) if False else SectorBlocks(RowSector(2, 0, 1, 4), 5),
    ScaledBlocks(SectorBlocks(RowSector(2, 0, 1, 4), 5), ResidualDistance(0.1, 8.0)),
    KrylovLocaliser(RowSector(0, 0, 0, 4, 0), 5, LIMIT),
    KrylovLocaliser(RowSector(2, 0, 1, 4, 0), 5, LIMIT),
    KrylovLocaliser(RowSector(1, 2, 1, 4, 1), 5, LIMIT),
]
