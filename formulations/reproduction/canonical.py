"""Section 3, the canonical Jacobian (20) and its like for any task space and manipulator."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations import measures
from formulations.reproduction import reference
from formulations.reproduction.row import Row, shown, shown_error
from formulations.reproduction.verdicts import equal, holds
from nlp.arrays import FloatArray

_ROUNDING = 1e-12


def rows(seed: int = 0, jacobian: FloatArray = reference.CANONICAL_6X7) -> Iterator[Row]:
    """Rows of eq. (20) and of the claims around it."""
    values = measures.singular_values(jacobian)
    verdict = equal(1, values, _ROUNDING)
    yield Row("(20)", "singular values", "σ = 1, isotropic", shown(values), verdict)
    shares = measures.null_space_contributions(jacobian)
    ours = f"{shown(shares.min())} to {shown(shares.max())}"
    verdict = equal(1 / 7, shares, _ROUNDING)
    yield Row("(20)", "N_i, i = 1, …, 7", "equal, so 1/7", ours, verdict)
    yield _worst_case_row(jacobian)
    yield _simplex_row(jacobian)
    yield _any_dimension_row()
    yield _screw_row(jacobian)
    yield _premultiplied_row(jacobian, seed)


def _worst_case_row(jacobian: FloatArray) -> Row:
    sigmas = measures.locked_singular_values(jacobian)
    paper = f"√(1/7) = {shown(np.sqrt(1 / 7))}"
    ours = f"{shown(sigmas.min())} to {shown(sigmas.max())}"
    verdict = equal(np.sqrt(1 / 7), sigmas, _ROUNDING)
    return Row("(20)", "fσ_6 for f = 1, …, 7", paper, ours, verdict, "eq. (6) with equality")


def _simplex_row(jacobian: FloatArray) -> Row:
    m, n = jacobian.shape
    error = float(np.max(np.abs(jacobian - reference.simplex_jacobian(m))))
    sizes = range(1, 13)
    shares = [
        measures.worst_case_sigma(reference.simplex_jacobian(k)) / np.sqrt(1 / (k + 1))
        for k in sizes
    ]
    verdict = holds(error <= _ROUNDING and max(abs(s - 1) for s in shares) <= _ROUNDING)
    return Row(
        "(20)",
        "the same pattern for m = 1, …, 12, n = m + 1: worst case over √((n−m)/n)",
        "a task space of any dimension",
        shown(max(shares, key=lambda share: abs(share - 1))),
        verdict,
        f"regular simplex; for m = {m}, n = {n} the print {shown_error(error, _ROUNDING)}",
    )


def _any_dimension_row() -> Row:
    shapes = [(m, n) for m in range(1, 9) for n in range(m + 1, 17)]
    shares = [
        measures.worst_case_sigma(reference.harmonic_jacobian(m, n)) / np.sqrt((n - m) / n)
        for m, n in shapes
    ]
    return Row(
        "(20)",
        "m = 1, …, 8, n = m + 1, …, 16: worst case over √((n−m)/n)",
        "a manipulator of any dimension",
        shown(max(shares, key=lambda share: abs(share - 1))),
        equal(1, shares, _ROUNDING),
        "the paper prints n = m + 1 only; our construction for n > m + 1: harmonic frames",
    )


def _screw_row(jacobian: FloatArray) -> Row:
    velocity, axis = jacobian[:3], jacobian[3:]
    pitch = np.abs(np.sum(velocity * axis, axis=0))
    turning = np.linalg.norm(axis, axis=0)
    revolute = (turning > _ROUNDING) & (pitch <= _ROUNDING)
    screws = int(np.sum(pitch > _ROUNDING))
    sliding = int(np.sum(turning <= _ROUNDING))
    return Row(
        "after (20)",
        "columns of (20) that a revolute joint can contribute",
        "none: arbitrary screws",
        str(int(np.sum(revolute))),
        holds(not np.any(revolute)),
        f"{screws} columns are screws with v·ω ≠ 0, {sliding} have ω = 0",
    )


def _premultiplied_row(jacobian: FloatArray, seed: int) -> Row:
    rng = np.random.default_rng(seed)
    before = measures.locked_singular_values(jacobian)
    changes = []
    for _ in range(100):
        turn = np.linalg.qr(rng.standard_normal((6, 6)))[0]
        after = measures.locked_singular_values(turn @ jacobian)
        changes.append(np.max(np.abs(after - before)))
    change = float(max(changes))
    return Row(
        "after (20)",
        "change of fσ_6 under UJ, U orthogonal",
        "none",
        shown_error(change, _ROUNDING),
        holds(change <= _ROUNDING),
        "100 random U",
    )
