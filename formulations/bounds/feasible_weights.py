"""More weight on the conditions of the joints, until a rounded proof is feasible.

What comes in: a `RelaxationProof` whose slacks S_g, shape (m, m) of each kind g of joint, may
have negative eigenvalues: its multipliers were rounded. What goes out: other weights λ of the
conditions, mostly larger ones, under which each S_g is positive semidefinite. The bound pays
for larger ones. The letters are those of `relaxation_rounding`.

S_g = Σ λA + terms without λ, so more weight on a condition with A ⪰ 0 only raises it. The
shared conditions of the library's joints have such an A: they are on the norm of a column, or
of a part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from lockedjoint.formulations.bounds.exact_matrices import (
    MARGINS,
    Exact,
    exact,
    is_semidefinite,
    zeros,
)
from lockedjoint.formulations.bounds.frame_symmetry import SPATIAL_ROWS
from lockedjoint.formulations.bounds.relaxation_proof import RelaxationProof
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.gram_conditions import GramCondition
from lockedjoint.formulations.joints.parts import JointKind, Parts

# Number of linear rows of a spatial Jacobian.
_LINEAR_ROWS = 3
# Largest denominator of the weights that `_weights_of_unit` finds in double precision: matrices
# of conditions have simple entries, and the result is checked exactly.
_LARGEST_DENOMINATOR = 10**6
# Number of results of `_weights_of_unit` that are kept: arms have few kinds of joints.
_KEPT_WEIGHTS = 512


def feasible_weights(
    rough: RelaxationProof, parts_apart: bool
) -> tuple[tuple[Fraction, ...], ...]:
    """Return λ of the conditions of each kind g of joint, so that S_g is semidefinite.

    The result has a tuple for each kind, and in it a weight for each condition of the kind.
    `parts_apart` is that of `frame_symmetry.FrameSymmetry`.
    """
    kinds = zip(rough.parts.kinds, rough.conditions, rough.slacks, strict=True)
    lifted = [_lifted(kind, weights, slack, parts_apart) for kind, weights, slack in kinds]
    return _with_shared(rough.parts, lifted)


def _with_shared(
    parts: Parts, weights: Sequence[Sequence[Fraction]]
) -> tuple[tuple[Fraction, ...], ...]:
    """Return weights of which those of a shared condition are in proportion to counts.

    A shared condition is one on the mean over all joints of the kinds that are alike, with n_g
    joints of the kind g: tr A Σ_g n_g X_g ≤ b Σ_g n_g. Its one multiplier μ gives kind g the
    weight n_g μ. μ is the largest weight/n_g that a kind needs.
    """
    proportional = [list(one) for one in weights]
    for number, kind in enumerate(parts.kinds):
        for place, condition in enumerate(kind.conditions):
            if condition.shared:
                alike = parts.alike(number)
                largest = max(weights[k][place] / parts.kinds[k].count for k in alike)
                proportional[number][place] = largest * kind.count
    return tuple(tuple(one) for one in proportional)


def _lifted(
    kind: JointKind,
    weights: tuple[Fraction, ...],
    slack: Exact,
    parts_apart: bool,
) -> tuple[Fraction, ...]:
    """Return weights with more on what bounds the norm, so that the slack is semidefinite.

    Conditions whose matrices add up to the unit matrix, with the weights of
    `_weights_of_unit`, bound |j|². More of these weights adds a multiple of the unit matrix to
    the slack. With `parts_apart` conditions that bound |v|² and |ω|² are used one by one, where
    there are any.
    """
    m = len(slack)
    halves = [slice(0, m)]
    if parts_apart and m == SPATIAL_ROWS:
        halves = [slice(0, _LINEAR_ROWS), slice(_LINEAR_ROWS, m)]
    found = [_weights_of_unit(kind.conditions, rows.start, rows.stop) for rows in halves]
    # If the conditions do not bound one of the halves, they may still bound all of |j|².
    if any(one is None for one in found):
        halves = [slice(0, m)]
        found = [_weights_of_unit(kind.conditions, 0, m)]
    weights_of_units = [one for one in found if one is not None]
    if not weights_of_units:
        raise CertificateError(
            f"the conditions {kind.conditions} do not bound the norm of a column"
        )
    if parts_apart:
        return _lifted_diagonal(kind.conditions, weights, slack, halves, weights_of_units)
    # There is one half, all rows, so `weights_of_units` has one entry. The slack counts on the
    # support of the kind only: a column is 0 beside it.
    return _lifted_whole(weights, kind.on_support(slack), weights_of_units[0])


def _lifted_diagonal(
    conditions: tuple[GramCondition, ...],
    weights: tuple[Fraction, ...],
    slack: Exact,
    halves: Sequence[slice],
    weights_of_units: Sequence[tuple[Fraction, ...]],
) -> tuple[Fraction, ...]:
    """Return weights that raise, or lower, the least entry of a diagonal slack to 0.

    The symmetry `parts_apart` makes the slack diagonal, with one number in each of v and ω.
    `weights_of_units` has for each of the halves the weights with which the conditions add up
    to the unit matrix of its rows.
    """
    for rows, weights_of_unit in zip(halves, weights_of_units, strict=True):
        least = min(slack[k, k] for k in range(len(slack))[rows])
        moved = [w - least * x for w, x in zip(weights, weights_of_unit, strict=True)]
        weights = tuple(
            value if one.equal else max(value, Fraction(0))
            for one, value in zip(conditions, moved, strict=True)
        )
    return weights


def _lifted_whole(
    weights: tuple[Fraction, ...], slack: Exact, weights_of_unit: tuple[Fraction, ...]
) -> tuple[Fraction, ...]:
    """Return weights that add the least multiple of I that makes a slack semidefinite."""
    numbers = slack.astype(float)
    scale = float(np.abs(numbers).max())
    below = max(0.0, -float(np.linalg.eigvalsh(numbers)[0]))
    for margin in MARGINS:
        more = Fraction(below + margin * scale)
        if is_semidefinite(slack + more * exact(np.eye(len(slack)))):
            return tuple(w + more * x for w, x in zip(weights, weights_of_unit, strict=True))
    raise CertificateError("the multipliers are too inaccurate to be rounded")


@lru_cache(maxsize=_KEPT_WEIGHTS)
def _weights_of_unit(
    conditions: tuple[GramCondition, ...], first: int, last: int
) -> tuple[Fraction, ...] | None:
    """Return weights x with Σ xA = the unit matrix of the rows first ≤ k < last, or None.

    Weights of inequalities are at least 0.
    """
    matrices = [np.array(one.matrix) for one in conditions]
    m = len(matrices[0])
    unit = np.diag([float(first <= k < last) for k in range(m)])
    # The columns of `design`, shape (m², conditions), are the matrices A.
    design = np.stack([x.ravel() for x in matrices], axis=1)
    found, *_ = np.linalg.lstsq(design, unit.ravel(), rcond=None)
    weights = [Fraction(float(x)).limit_denominator(_LARGEST_DENOMINATOR) for x in found]
    total = sum((w * exact(x) for w, x in zip(weights, matrices, strict=True)), zeros(m))
    signed = all(w >= 0 or one.equal for w, one in zip(weights, conditions, strict=True))
    return tuple(weights) if signed and np.array_equal(total, exact(unit)) else None
