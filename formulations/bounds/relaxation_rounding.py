"""From a solver's multipliers of the relaxation to a proof.

What comes in: a `RelaxationSolution`, with multipliers in double precision. What goes out: a
`RelaxationProof` in fractions, which is checked. In between, multipliers are averaged over the
symmetries of the joints' conditions (`frame_symmetry`), rounded to fractions (here), and made
feasible (`feasible_weights`).

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

from dataclasses import replace
from fractions import Fraction

import numpy as np

from lockedjoint.formulations.bounds.exact_matrices import (
    MARGINS,
    Exact,
    exact,
    is_semidefinite,
    zeros,
)
from lockedjoint.formulations.bounds.feasible_weights import feasible_weights
from lockedjoint.formulations.bounds.frame_symmetry import FrameSymmetry
from lockedjoint.formulations.bounds.relaxation_proof import (
    BlockSum,
    RelaxationProof,
    tangent_of_sum,
)
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.gram_conditions import GramCondition
from lockedjoint.formulations.relaxation import RelaxationSolution
from lockedjoint.nlp.arrays import FloatArray, nearest_semidefinite

# Shares of the largest multiplier below which a multiplier may be the solver's zero. Each is
# tried, and the best proof counts; more shares take longer.
_ZEROS = (1e-8, 0.0, 1e-5)
# Relative distance of a proved bound from the solver's below which no other share is tried.
_SHARP = 1e-11
# Size of the off-diagonal entries, as a share of the largest entry, that counts as rounding:
# they become 0 then, and the fractions stay short.
_DIAGONAL = 1e-15


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
    symmetry = FrameSymmetry.of(solution.problem.parts)
    rough = _rounded(solution, symmetry, zero)
    weights = feasible_weights(rough, symmetry.parts_apart)
    proof = replace(rough, conditions=weights, level=rough.proved_level(weights))
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
    rough = _rounded(solution, FrameSymmetry(), 0.0)
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


def _rounded(
    solution: RelaxationSolution, symmetry: FrameSymmetry, zero: float
) -> RelaxationProof:
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


def _rounded_residual(solution: RelaxationSolution, symmetry: FrameSymmetry) -> RelaxationProof:
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
    solution: RelaxationSolution, symmetry: FrameSymmetry, unit: Fraction
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
    solution: RelaxationSolution, symmetry: FrameSymmetry, number: int, condition: GramCondition
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
    solution: RelaxationSolution, symmetry: FrameSymmetry, number: int, least: float
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
    for margin in MARGINS:
        trial = exact(near + margin * scale * np.eye(len(near)))
        if is_semidefinite(trial):
            return trial
    raise CertificateError("the multiplier of a failure is too inaccurate to be rounded")
