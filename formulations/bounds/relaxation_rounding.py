"""From a solver's multipliers of the relaxation to a proof.

Multipliers are averaged over the symmetries of the joints' conditions, where these have them:
then the numbers that are left are multiples of unit matrices, and what rounding costs is of
second order. They become fractions, and are made feasible by more weight on the conditions of
the joints, which is paid for in the bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache

import numpy as np

from lockedjoint.formulations.bounds.exact_matrices import (
    Exact,
    exact,
    is_semidefinite,
    zeros,
)
from lockedjoint.formulations.bounds.relaxation_proof import (
    BlockSum,
    RelaxationProof,
    tangent_of_sum,
)
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.gram_conditions import GramCondition
from lockedjoint.formulations.joints.parts import Kind, Parts
from lockedjoint.formulations.relaxation import RelaxationSolution
from lockedjoint.nlp.arrays import FloatArray, nearest_semidefinite

# Multiples of the largest entry that are added to a matrix until it is semidefinite.
_MARGINS = (0.0, *(10.0**-k for k in range(16, 5, -1)))
# Multipliers below one of these shares of the largest may be the solver's zero: all are tried.
_ZEROS = (1e-8, 0.0, 1e-5)
# A proof that is so close to the solver's value, relative to it, is not improved on.
_SHARP = 1e-11
_LARGEST_DENOMINATOR = 10**6


def prove(solution: RelaxationSolution) -> RelaxationProof:
    """Return the proof that follows from a solver's multipliers.

    Raises
    ------
    CertificateError
        If none does: the solver has failed, or its answer is too inaccurate.
    """
    if not solution.multipliers:
        raise CertificateError(f"{solution.solver} has no multipliers: {solution.status}")
    proofs: list[RelaxationProof] = []
    why = CertificateError("the multipliers prove nothing")
    for zero in _ZEROS:
        try:
            proofs.append(_proof(solution, zero))
        except CertificateError as error:
            why = error
        else:
            if abs(proofs[-1].bound - solution.bound) <= _SHARP * abs(solution.bound):
                break
    if not proofs:
        raise why
    sign = -1 if solution.problem.statement == "residual" else 1
    return min(proofs, key=lambda proof: sign * proof.level)


def _proof(solution: RelaxationSolution, zero: float) -> RelaxationProof:
    """Return the proof that treats multipliers below a share of the largest as 0."""
    symmetry = Symmetry.of(solution.problem.parts)
    rough = _rounded(solution, symmetry, zero)
    made = replace(rough, conditions=_feasible(rough, symmetry))
    proof = replace(made, level=made.proved_level())
    proof.check()
    return proof


def accuracy(solution: RelaxationSolution) -> tuple[float, float]:
    """Return how far a solver's multipliers are from their equations, and from the cone.

    Returns
    -------
    float
        The largest of |1 − mΣλb/T| and of the entries of W_YY − μC, W a block's multiplier.
    float
        The smallest eigenvalue of all Z_F, W and S_g.
    """
    problem, given = solution.problem, solution.multipliers
    rough = _rounded(solution, Symmetry(), 0.0)
    pairs = zip(rough.parts.kinds, rough.slacks, strict=True)
    matrices = [kind.on_support(slack).astype(float) for kind, slack in pairs]
    residuals = [0.0]
    if problem.statement != "residual":
        price = sum(
            float(weight) * condition.limit
            for kind, weights in zip(rough.parts.kinds, rough.conditions, strict=True)
            for condition, weight in zip(kind.conditions, weights, strict=True)
        )
        residuals.append(abs(1 - price / problem.scale))
        matrices += [_symmetric(given[f"failure {one.counts}"]) for one in rough.parts.sets]
    for block, one in zip(rough.parts.blocks, rough.sums, strict=False):
        whole = _symmetric(given[f"inverse, {block.name}"])
        tangent, _ = tangent_of_sum(rough.parts, block, one.point)
        weighted = given[f"all failures, {block.name}"].item() * tangent.astype(float)
        residuals.append(float(np.abs(whole[: block.size, : block.size] - weighted).max()))
        matrices.append(whole)
    least = min(float(np.linalg.eigvalsh(matrix)[0]) for matrix in matrices)
    return max(residuals), least


@dataclass(frozen=True)
class Symmetry:
    """What rotations and reflections of the frame leave of matrices, on average.

    Attributes
    ----------
    complete
        Whether the conditions of all joints are the same in all frames.
    parts_apart
        Whether they also are if v alone changes its sign.
    """

    complete: bool = False
    parts_apart: bool = False

    @classmethod
    def of(cls, parts: Parts) -> Symmetry:
        """Return the symmetries of the conditions of all joints."""
        conditions = [one for kind in parts.kinds for one in kind.conditions]
        matrices = [np.array(one.matrix) for one in conditions]
        complete = all(np.array_equal(x, _turned_mean(x, cross=True)) for x in matrices)
        apart = complete and all(
            (one.equal and one.limit == 0) or np.array_equal(x, _turned_mean(x, cross=False))
            for one, x in zip(conditions, matrices, strict=True)
        )
        return cls(complete, apart)

    def mean(self, matrix: FloatArray) -> FloatArray:
        """Return the mean of a matrix over all frames; the matrix itself if they differ."""
        return _turned_mean(matrix, cross=not self.parts_apart) if self.complete else matrix

    def weight(self, condition: GramCondition, value: float) -> Fraction:
        """Return the mean of a condition's multiplier; at least 0 of an inequality."""
        matrix = np.array(condition.matrix)
        if self.parts_apart and not np.array_equal(matrix, _turned_mean(matrix, cross=False)):
            return Fraction(0)
        return Fraction(value if condition.equal else max(value, 0.0))


def _turned_mean(matrix: FloatArray, cross: bool) -> FloatArray:
    """Return multiples of unit matrices with the same traces, of spatial rows four of them."""
    size = len(matrix)
    if size != 6:
        return np.asarray(np.trace(matrix) / size * np.eye(size))
    means = matrix.reshape(2, 3, 2, 3).trace(axis1=1, axis2=3) / 3
    means = 0.5 * (means + means.T)
    return np.asarray(np.kron(means if cross else np.diag(np.diag(means)), np.eye(3)))


def _rounded(solution: RelaxationSolution, symmetry: Symmetry, zero: float) -> RelaxationProof:
    """Return the multipliers as fractions; those of the conditions are not feasible yet."""
    problem, given = solution.problem, solution.multipliers
    parts, m = problem.parts, problem.parts.task_dimension
    unit = Fraction(problem.scale) if problem.statement == "residual" else Fraction(1)
    conditions = tuple(
        tuple(unit * _averaged(solution, symmetry, number, one) for one in kind.conditions)
        for number, kind in enumerate(parts.kinds)
    )
    shell = RelaxationProof(
        problem.statement, parts, conditions, (), (), zeros(m), (), Fraction(0)
    )
    if problem.statement == "residual":
        gram = sum(
            kind.count * np.asarray(x.value)
            for kind, x in zip(parts.kinds, problem.squares, strict=True)
        )
        deviation = gram - np.trace(gram) / m * np.eye(m)
        return replace(shell, isotropic=unit * exact(symmetry.mean(_symmetric(deviation))))
    least = zero * max(float(np.abs(value).max(initial=0.0)) for value in given.values())
    failures = tuple(
        _semidefinite(symmetry.mean(_symmetric(given[f"failure {one.counts}"])), least)
        for one in parts.sets
    )
    sums = tuple(
        _block_sum(solution, symmetry, number, least) for number in range(len(parts.blocks))
    )
    if problem.statement == "max-min":
        return replace(shell, failures=failures, sums=sums)
    norms = tuple(
        tuple(
            Fraction(_above(given[f"norm {number} of {one.counts}"].item(), least))
            if count
            else Fraction(0)
            for number, count in enumerate(one.counts)
        )
        for one in parts.sets
    )
    isotropic = exact(symmetry.mean(_symmetric(given["isotropic"])))
    return replace(shell, failures=failures, sums=sums, isotropic=isotropic, norms=norms)


def _averaged(
    solution: RelaxationSolution, symmetry: Symmetry, number: int, condition: GramCondition
) -> Fraction:
    """Return the multiplier of a condition on a kind of joint, of a shared one its share."""
    parts = solution.problem.parts
    given = solution.multipliers.get(parts.condition_name(number, condition))
    value = 0.0 if given is None else given.item()
    sharing = parts.alike(number) if condition.shared else (number,)
    every = sum(parts.kinds[k].count for k in sharing)
    share = Fraction(parts.kinds[number].count, every) if condition.shared else 1
    return share * symmetry.weight(condition, value)


def _block_sum(
    solution: RelaxationSolution, symmetry: Symmetry, number: int, least: float
) -> BlockSum:
    """Return the multipliers of a block's sum; none where it does not count."""
    block = solution.problem.parts.blocks[number]
    m = block.size
    weight = solution.multipliers[f"all failures, {block.name}"].item()
    whole = _symmetric(solution.multipliers[f"inverse, {block.name}"])
    point = solution.problem.named[f"inverse, {block.name}"].args[0].value[:m, :m]
    rounded = exact(symmetry.mean(_symmetric(np.asarray(point, dtype=float))))
    tangent, _ = tangent_of_sum(solution.problem.parts, block, rounded)
    if weight <= least or not is_semidefinite(tangent, strictly=True):
        return BlockSum(Fraction(0), zeros(m), rounded)
    inverse = symmetry.mean(-_symmetric(whole[:m, m:]))
    return BlockSum(Fraction(weight), exact(inverse), rounded)


def _feasible(rough: RelaxationProof, symmetry: Symmetry) -> tuple[tuple[Fraction, ...], ...]:
    """Return weights of the conditions, of each kind of joint, that make S_g semidefinite."""
    kinds = zip(rough.parts.kinds, rough.conditions, rough.slacks, strict=True)
    lifted = [
        _lifted(kind, weights, slack, symmetry.parts_apart) for kind, weights, slack in kinds
    ]
    return _with_shared(rough.parts, lifted)


def _with_shared(
    parts: Parts, weights: Sequence[Sequence[Fraction]]
) -> tuple[tuple[Fraction, ...], ...]:
    """Return weights of which those of a condition on the mean are in proportion to counts."""
    made = [list(one) for one in weights]
    for number, kind in enumerate(parts.kinds):
        for place, condition in enumerate(kind.conditions):
            if condition.shared:
                alike = parts.alike(number)
                largest = max(weights[k][place] / parts.kinds[k].count for k in alike)
                made[number][place] = largest * kind.count
    return tuple(tuple(one) for one in made)


def _lifted(
    kind: Kind,
    weights: tuple[Fraction, ...],
    slack: Exact,
    parts_apart: bool,
) -> tuple[Fraction, ...]:
    """Return weights with more on what bounds the norm, so that the slack is semidefinite."""
    conditions, m = kind.conditions, len(slack)
    halves = [slice(0, 3), slice(3, 6)] if parts_apart and m == 6 else [slice(0, m)]
    shares = [_combination(conditions, rows.start, rows.stop) for rows in halves]
    if any(share is None for share in shares):
        halves = [slice(0, m)]
        shares = [_combination(conditions, 0, m)]
    if shares[0] is None:
        raise CertificateError(f"the conditions {conditions} do not bound the norm of a column")
    if parts_apart:  # the slack is diagonal, of one number in each half
        for rows, share in zip(halves, shares, strict=True):
            assert share is not None
            least = min(slack[k, k] for k in range(m)[rows])
            moved = tuple(w - least * x for w, x in zip(weights, share, strict=True))
            weights = tuple(
                value if one.equal else max(value, Fraction(0))
                for one, value in zip(conditions, moved, strict=True)
            )
        return weights
    slack = kind.on_support(slack)
    numbers = slack.astype(float)
    scale = float(np.abs(numbers).max())
    below = max(0.0, -float(np.linalg.eigvalsh(numbers)[0]))
    for margin in _MARGINS:
        more = Fraction(below + margin * scale)
        if is_semidefinite(slack + more * exact(np.eye(len(slack)))):
            return tuple(w + more * x for w, x in zip(weights, shares[0], strict=True))
    raise CertificateError("the multipliers are too inaccurate to be rounded")


@lru_cache(maxsize=512)
def _combination(
    conditions: tuple[GramCondition, ...], first: int, last: int
) -> tuple[Fraction, ...] | None:
    """Return weights that make of the conditions the sum of squares of these rows, or None."""
    matrices = [np.array(one.matrix) for one in conditions]
    m = len(matrices[0])
    unit = np.diag([float(first <= k < last) for k in range(m)])
    design = np.stack([x.ravel() for x in matrices], axis=1)
    found, *_ = np.linalg.lstsq(design, unit.ravel(), rcond=None)
    weights = [Fraction(float(x)).limit_denominator(_LARGEST_DENOMINATOR) for x in found]
    total = sum((w * exact(x) for w, x in zip(weights, matrices, strict=True)), zeros(m))
    signed = all(w >= 0 or one.equal for w, one in zip(weights, conditions, strict=True))
    return tuple(weights) if signed and np.array_equal(total, exact(unit)) else None


def _above(value: float, least: float) -> float:
    return value if value > least else 0.0


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (matrix + matrix.T))


def _semidefinite(matrix: FloatArray, least: float) -> Exact:
    """Return fractions close to a matrix, positive semidefinite; 0 if no entry is above."""
    near = _symmetric(nearest_semidefinite(matrix))
    if np.abs(near).max() <= least:
        return zeros(len(near))
    diagonal = np.diag(np.diag(near))
    if np.abs(near - diagonal).max() <= 1e-15 * np.abs(near).max():
        return exact(diagonal)
    scale = float(np.abs(near).max())
    for margin in _MARGINS:
        trial = exact(near + margin * scale * np.eye(len(near)))
        if is_semidefinite(trial):
            return trial
    raise CertificateError("the multiplier of a failure is too inaccurate to be rounded")
