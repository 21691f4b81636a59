"""From a solver's multipliers of the relaxation to a proof.

Multipliers are averaged over the symmetries of the joints' conditions, where these have them:
then the numbers that are left are multiples of unit matrices, and what rounding costs is of
second order. They become fractions, and are made feasible by more weight on the conditions of
the joints, which is paid for in the bound.

The letters are those of `relaxation` (the program) and `relaxation_proof` (what is proved). All
matrices are in the units of the rows. m is the number of rows of J, m_B that of a block B:

- A and b: matrix (m, m) and limit of a joint's condition ⟨A, jjᵀ⟩ = b or ≤ b; λ: its
  multiplier, a number;
- T: the largest ‖J‖_F²; `Relaxation.scale` is T/m;
- Z_F: multiplier (m, m) of the condition on the failure F, positive semidefinite;
- W: multiplier (2m_B, 2m_B) of the condition ``inverse`` of a block, whose matrix has Y_B as
  its first m_B rows and columns. W_YY is the part of W at Y_B;
- μ: multiplier of the condition ``all failures`` of a block, a number of at least 0; C: the
  slope (m_B, m_B) of this condition in Y_B, at a point Y₀. Optimality says W_YY = μC;
- Q: minus the part of W in the rows of Y_B and the other columns, shape (m_B, m_B);
- N: multiplier (m, m) of isotropy; of the residual the deviation of JJᵀ from a multiple of I;
- S_g: the slack (m, m) of the joints of kind g. A proof needs it positive semidefinite.
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

# Multiples of the largest entry that are added to the diagonal, until a matrix is
# semidefinite: 0, then from the rounding of doubles (1e-16) to the errors of a solver (1e-6).
_MARGINS = (0.0, *(10.0**-k for k in range(16, 5, -1)))
# Multipliers below one of these shares of the largest may be the solver's zero: all are tried.
_ZEROS = (1e-8, 0.0, 1e-5)
# Relative distance of a proved bound from the solver's below which no other share is tried.
_SHARP = 1e-11
# Largest denominator of the weights that `_combination` finds in double precision: matrices of
# conditions have simple entries, and the result is checked exactly.
_LARGEST_DENOMINATOR = 10**6
# Size of the off-diagonal entries, as a share of the largest entry, that counts as rounding.
_DIAGONAL = 1e-15
# Number of rows of a spatial Jacobian: linear rows first, then as many rotational ones.
_SPATIAL_ROWS = 6
# Number of its linear rows.
_LINEAR_ROWS = 3


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
    """Return the proof that treats multipliers below `zero` times the largest as 0."""
    symmetry = Symmetry.of(solution.problem.parts)
    rough = _rounded(solution, symmetry, zero)
    feasible = replace(rough, conditions=_feasible(rough, symmetry))
    proof = replace(feasible, level=feasible.proved_level())
    proof.check()
    return proof


def accuracy(solution: RelaxationSolution) -> tuple[float, float]:
    """Return how far a solver's multipliers are from their equations, and from the cone.

    Returns
    -------
    float
        The largest of |1 − mΣλb/T| and of the absolute entries of W_YY − μC of all blocks.
        For the residual it is 0: it has none of these equations.
    float
        The smallest eigenvalue of all Z_F, W and S_g.
    """
    problem, given = solution.problem, solution.multipliers
    is_residual = problem.statement == "residual"
    rough = _rounded(solution, Symmetry(), 0.0)
    pairs = zip(rough.parts.kinds, rough.slacks, strict=True)
    matrices = [kind.on_support(slack).astype(float) for kind, slack in pairs]
    residuals = [0.0]
    if not is_residual:
        price = sum(
            float(weight) * condition.limit
            for kind, weights in zip(rough.parts.kinds, rough.conditions, strict=True)
            for condition, weight in zip(kind.conditions, weights, strict=True)
        )
        residuals.append(abs(1 - price / problem.scale))
        matrices += [_symmetric(given[f"failure {one.counts}"]) for one in rough.parts.sets]
    # The residual has no multipliers of sums, although its parts have blocks.
    for block, block_sum in zip(rough.parts.blocks, rough.sums, strict=not is_residual):
        w = _symmetric(given[f"inverse, {block.name}"])
        slope, _ = tangent_of_sum(rough.parts, block, block_sum.point)
        mu = given[f"all failures, {block.name}"].item()
        w_yy = w[: block.size, : block.size]
        residuals.append(float(np.abs(w_yy - mu * slope.astype(float)).max()))
        matrices.append(w)
    least = min(float(np.linalg.eigvalsh(matrix)[0]) for matrix in matrices)
    return max(residuals), least


@dataclass(frozen=True)
class Symmetry:
    """What rotations and reflections of the frame leave of matrices, on average.

    Spatial columns are (v; ω): v has the linear rows and ω the rotational ones. A mean over all
    frames consists of multiples of 3×3 unit matrices then: one for v with v, one for ω with ω
    and one for v with ω. In other task spaces it is one multiple of the unit matrix.

    Attributes
    ----------
    complete
        Whether the conditions of all joints are the same in all frames.
    parts_apart
        Whether they also are if v alone changes its sign: the multiple for v with ω is 0.
    """

    complete: bool = False
    parts_apart: bool = False

    @classmethod
    def of(cls, parts: Parts) -> Symmetry:
        """Return the symmetries of the conditions of all joints."""
        conditions = [one for kind in parts.kinds for one in kind.conditions]
        matrices = [np.array(one.matrix) for one in conditions]
        complete = all(np.array_equal(x, _turned_mean(x, cross=True)) for x in matrices)
        # A condition with the limit 0, such as v·ω = 0, holds with either sign of v.
        parts_apart = complete and all(
            (one.equal and one.limit == 0) or np.array_equal(x, _turned_mean(x, cross=False))
            for one, x in zip(conditions, matrices, strict=True)
        )
        return cls(complete=complete, parts_apart=parts_apart)

    def mean(self, matrix: FloatArray) -> FloatArray:
        """Return the mean of a matrix over all frames; itself if conditions depend on these."""
        return _turned_mean(matrix, cross=not self.parts_apart) if self.complete else matrix

    def weight(self, condition: GramCondition, value: float) -> Fraction:
        """Return the mean of a condition's multiplier λ; at least 0 of an inequality."""
        matrix = np.array(condition.matrix)
        if self.parts_apart and not np.array_equal(matrix, _turned_mean(matrix, cross=False)):
            return Fraction(0)
        return Fraction(value if condition.equal else max(value, 0.0))


def _turned_mean(matrix: FloatArray, cross: bool) -> FloatArray:
    """Return the mean of a matrix over all frames, shape (m, m).

    It has multiples of unit matrices with the same traces, see `Symmetry`: of spatial rows four
    of them, of which those for v with ω are 0 without `cross`.
    """
    size = len(matrix)
    if size != _SPATIAL_ROWS:
        return np.asarray(np.trace(matrix) / size * np.eye(size))
    # Axes of `quarters`: (v or ω, its row, v or ω, its column). Shape of `means`: (2, 2).
    quarters = matrix.reshape(2, 3, 2, 3)
    means = quarters.trace(axis1=1, axis2=3) / 3
    means = 0.5 * (means + means.T)
    kept = means if cross else np.diag(np.diag(means))
    return np.asarray(np.kron(kept, np.eye(3)))


def _rounded(solution: RelaxationSolution, symmetry: Symmetry, zero: float) -> RelaxationProof:
    """Return the multipliers as fractions; those of the conditions are not feasible yet.

    The level is 0 until these are. Multipliers below `zero` times the largest become 0.
    """
    problem, given = solution.problem, solution.multipliers
    parts = problem.parts
    if problem.statement == "residual":
        return _rounded_residual(solution, symmetry)
    largest = max(float(np.abs(value).max(initial=0.0)) for value in given.values())
    least = zero * largest
    max_min = RelaxationProof(
        statement=problem.statement,
        parts=parts,
        conditions=_condition_weights(solution, symmetry, Fraction(1)),
        failures=tuple(
            _semidefinite(symmetry.mean(_symmetric(given[f"failure {one.counts}"])), least)
            for one in parts.sets
        ),
        sums=tuple(
            _block_sum(solution, symmetry, number, least) for number in range(len(parts.blocks))
        ),
        isotropic=zeros(parts.task_dimension),
        norms=(),
        level=Fraction(0),
    )
    if problem.statement == "max-min":
        return max_min
    return replace(
        max_min,
        isotropic=exact(symmetry.mean(_symmetric(given["isotropic"]))),
        norms=_norm_weights(solution, least),
    )


def _rounded_residual(solution: RelaxationSolution, symmetry: Symmetry) -> RelaxationProof:
    """Return the multipliers of the residual: N follows from the solver's X, not from duals."""
    problem, parts = solution.problem, solution.problem.parts
    m = parts.task_dimension
    gram = sum(
        kind.count * np.asarray(x.value)
        for kind, x in zip(parts.kinds, problem.squares, strict=True)
    )
    deviation = gram - np.trace(gram) / m * np.eye(m)
    # The program is in units of T/m, the proof is not.
    unit = Fraction(problem.scale)
    return RelaxationProof(
        statement=problem.statement,
        parts=parts,
        conditions=_condition_weights(solution, symmetry, unit),
        failures=(),
        sums=(),
        isotropic=unit * exact(symmetry.mean(_symmetric(deviation))),
        norms=(),
        level=Fraction(0),
    )


def _condition_weights(
    solution: RelaxationSolution, symmetry: Symmetry, unit: Fraction
) -> tuple[tuple[Fraction, ...], ...]:
    """Return `unit`·λ of each condition (inner tuple) of each kind of joint (outer tuple)."""
    return tuple(
        tuple(unit * _averaged(solution, symmetry, number, one) for one in kind.conditions)
        for number, kind in enumerate(solution.problem.parts.kinds)
    )


def _norm_weights(
    solution: RelaxationSolution, least: float
) -> tuple[tuple[Fraction, ...], ...]:
    """Return the multiplier of the norm of each kind of joint (inner) in each failure (outer).

    It is 0 of a kind of which no joint locks, and if it is not above `least`.
    """
    given = solution.multipliers

    def weight(counts: tuple[int, ...], number: int) -> Fraction:
        if not counts[number]:
            return Fraction(0)
        value = given[f"norm {number} of {counts}"].item()
        return Fraction(value if value > least else 0.0)

    return tuple(
        tuple(weight(one.counts, number) for number in range(len(one.counts)))
        for one in solution.problem.parts.sets
    )


def _averaged(
    solution: RelaxationSolution, symmetry: Symmetry, number: int, condition: GramCondition
) -> Fraction:
    """Return λ of a condition on the kind of joint with this number.

    A shared condition is one on the mean over several kinds of joint: each has the share of λ
    that it has of the joints. The program leaves out a condition that always holds: λ is 0.
    """
    parts = solution.problem.parts
    given = solution.multipliers.get(parts.condition_name(number, condition))
    value = 0.0 if given is None else given.item()
    weight = symmetry.weight(condition, value)
    if not condition.shared:
        return weight
    joints = sum(parts.kinds[k].count for k in parts.alike(number))
    return Fraction(parts.kinds[number].count, joints) * weight


def _block_sum(
    solution: RelaxationSolution, symmetry: Symmetry, number: int, least: float
) -> BlockSum:
    """Return μ, Q and Y₀ of the block with this number.

    μ and Q are 0 where μ is not above `least`, or where C is not positive definite.
    """
    problem, given = solution.problem, solution.multipliers
    block = problem.parts.blocks[number]
    m = block.size
    mu = given[f"all failures, {block.name}"].item()
    w = _symmetric(given[f"inverse, {block.name}"])
    # The tangent is taken at the solver's Y_B, shape (m, m).
    y = np.asarray(problem.var_dict[f"Y {block.name}"].value, dtype=float)
    point = exact(symmetry.mean(_symmetric(y)))
    slope, _ = tangent_of_sum(problem.parts, block, point)
    if mu <= least or not is_semidefinite(slope, strictly=True):
        return BlockSum(weight=Fraction(0), inverse=zeros(m), point=point)
    q = symmetry.mean(-_symmetric(w[:m, m:]))
    return BlockSum(weight=Fraction(mu), inverse=exact(q), point=point)


def _feasible(rough: RelaxationProof, symmetry: Symmetry) -> tuple[tuple[Fraction, ...], ...]:
    """Return λ of the conditions of each kind g of joint, so that S_g is semidefinite."""
    kinds = zip(rough.parts.kinds, rough.conditions, rough.slacks, strict=True)
    lifted = [
        _lifted(kind, weights, slack, symmetry.parts_apart) for kind, weights, slack in kinds
    ]
    return _with_shared(rough.parts, lifted)


def _with_shared(
    parts: Parts, weights: Sequence[Sequence[Fraction]]
) -> tuple[tuple[Fraction, ...], ...]:
    """Return weights of which those of a shared condition are in proportion to counts.

    A shared condition has one multiplier for each joint: the largest that a kind needs.
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
    kind: Kind,
    weights: tuple[Fraction, ...],
    slack: Exact,
    parts_apart: bool,
) -> tuple[Fraction, ...]:
    """Return weights with more on what bounds the norm, so that the slack is semidefinite.

    Conditions whose matrices add up to the unit matrix, with the weights of `_combination`,
    bound |j|². More of these weights adds a multiple of the unit matrix to the slack. With
    `parts_apart` conditions that bound |v|² and |ω|² are used one by one, where there are any.
    """
    m = len(slack)
    halves = [slice(0, m)]
    if parts_apart and m == _SPATIAL_ROWS:
        halves = [slice(0, _LINEAR_ROWS), slice(_LINEAR_ROWS, m)]
    combinations = [_combination(kind.conditions, rows.start, rows.stop) for rows in halves]
    if any(one is None for one in combinations):
        halves = [slice(0, m)]
        combinations = [_combination(kind.conditions, 0, m)]
    shares = [one for one in combinations if one is not None]
    if not shares:
        raise CertificateError(
            f"the conditions {kind.conditions} do not bound the norm of a column"
        )
    if parts_apart:
        return _lifted_diagonal(kind.conditions, weights, slack, halves, shares)
    return _lifted_whole(weights, kind.on_support(slack), shares[0])


def _lifted_diagonal(
    conditions: tuple[GramCondition, ...],
    weights: tuple[Fraction, ...],
    slack: Exact,
    halves: Sequence[slice],
    shares: Sequence[tuple[Fraction, ...]],
) -> tuple[Fraction, ...]:
    """Return weights that raise, or lower, the least entry of a diagonal slack to 0.

    The symmetry `parts_apart` makes the slack diagonal, with one number in each of v and ω. A
    share has the weights of the conditions that add up to the unit matrix of these rows.
    """
    for rows, share in zip(halves, shares, strict=True):
        least = min(slack[k, k] for k in range(len(slack))[rows])
        moved = [w - least * x for w, x in zip(weights, share, strict=True)]
        weights = tuple(
            value if one.equal else max(value, Fraction(0))
            for one, value in zip(conditions, moved, strict=True)
        )
    return weights


def _lifted_whole(
    weights: tuple[Fraction, ...], slack: Exact, share: tuple[Fraction, ...]
) -> tuple[Fraction, ...]:
    """Return weights that add the least multiple of I that makes a slack semidefinite."""
    numbers = slack.astype(float)
    scale = float(np.abs(numbers).max())
    below = max(0.0, -float(np.linalg.eigvalsh(numbers)[0]))
    for margin in _MARGINS:
        more = Fraction(below + margin * scale)
        if is_semidefinite(slack + more * exact(np.eye(len(slack)))):
            return tuple(w + more * x for w, x in zip(weights, share, strict=True))
    raise CertificateError("the multipliers are too inaccurate to be rounded")


@lru_cache(maxsize=512)
def _combination(
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


def _symmetric(matrix: FloatArray) -> FloatArray:
    """Return the symmetric part of a square matrix."""
    return np.asarray(0.5 * (matrix + matrix.T))


def _semidefinite(matrix: FloatArray, least: float) -> Exact:
    """Return fractions close to a matrix, positive semidefinite; 0 if none is above `least`."""
    near = _symmetric(nearest_semidefinite(matrix))
    if np.abs(near).max() <= least:
        return zeros(len(near))
    diagonal = np.diag(np.diag(near))
    if np.abs(near - diagonal).max() <= _DIAGONAL * np.abs(near).max():
        return exact(diagonal)
    scale = float(np.abs(near).max())
    for margin in _MARGINS:
        trial = exact(near + margin * scale * np.eye(len(near)))
        if is_semidefinite(trial):
            return trial
    raise CertificateError("the multiplier of a failure is too inaccurate to be rounded")
