"""The semidefinite program in the pseudo-moments, from values at sampled configurations.

What comes in: values of blocks B(x) and of an objective ρ(x) at configurations x. What goes
out: a program in vectors and matrices. It is solved elsewhere (`solvers`); only the tools that
change a program or its multipliers are here too.

A pseudo-moment y_j is the value of a linear functional at a function e_j of x. The functions
e_0 = 1, e_1, … are orthonormal in the mean over the configurations, and span the entries of all
blocks and ρ. The functional that is 1 at the constant 1 is the vector y of its other values:

    minimise  ρ_0 + Σ_j ρ_j y_j   subject to   B_0 + Σ_j y_j B_j ⪰ 0 for every block,

where B_j, shape (size, size), holds the coefficients of e_j of the entries, and ρ_j that of ρ;
Σ_j is over j ≥ 1. Multipliers X ⪰ 0 of the blocks with Σ ⟨X, B_j⟩ = ρ_j for j ≥ 1, where Σ is
over the blocks, prove the bound ρ_0 − Σ ⟨X, B_0⟩. `MomentProgram.problem` states the program in
cvxpy.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from lockedjoint.nlp.arrays import FloatArray, semidefinite_root
from lockedjoint.nlp.errors import LockedJointError

# Ratio of singular values below which a function counts as none. Functions that are small
# where samples concentrate have ratios down to 3e-8; rounding makes 1e-15.
_RELATIVE_RANK = 1e-10
# Seed of the random combinations of entries. Any seed gives the same span.
_SEED = 7
# Error of an expanded function, relative to its largest value, above which it is outside of the
# span: far above rounding, and far below what a missing function makes.
_RELATIVE_ERROR = 1e-8
# Size that a function without values other than 0 counts as: its error is relative to it.
_TINY = 1e-300
# Least eigenvalue of all blocks at y = 0 of a penalised program. With a smaller one the solver
# starts nearer to the boundary, with a larger one the price of the shift grows.
_INTERIOR = 0.1
# Singular value of the equations, relative to the largest, below which one is left out.
_RELATIVE_STRENGTH = 1e-11
# Largest number of corrections of the multipliers.
_PASSES = 3


class TooFewSamplesError(LockedJointError):
    """The samples do not distinguish all functions: more are needed."""


class OutsideSpanError(LockedJointError):
    """The objective is no combination of the entries of the blocks."""


@dataclass(frozen=True, eq=False)
class MomentProgram:
    """Blocks and objective as functions of the pseudo-moments."""

    #: ρ_0, ρ_1, …, shape (moments,).
    objective: FloatArray
    #: Each block has B_0, B_1, …, shape (moments, size, size).
    blocks: tuple[FloatArray, ...]

    @property
    def moments(self) -> int:
        """Dimension of the span, that of the constants included."""
        return len(self.objective)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of rows of the blocks."""
        return tuple(block.shape[1] for block in self.blocks)

    @property
    def size(self) -> dict[str, int]:
        """Numbers of moments, blocks, rows of the largest, and distinct entries of all."""
        svec = sum(size * (size + 1) // 2 for size in self.sizes)
        largest = max(self.sizes, default=0)
        return {
            "moments": self.moments,
            "blocks": len(self.sizes),
            "largest_block": largest,
            "svec": svec,
        }

    def problem(self) -> cp.Problem:
        """State the program in cvxpy: a constraint for each block, in their order."""
        y = cp.Variable(self.moments - 1, name="y")
        blocks = []
        for block in self.blocks:
            slopes = block[1:].reshape(self.moments - 1, -1).T
            entries = slopes @ y + block[0].ravel()
            blocks.append(cp.reshape(entries, block.shape[1:], order="C") >> 0)
        return cp.Problem(cp.Minimize(self.objective[0] + self.objective[1:] @ y), blocks)

    def dual_value(self, multipliers: Sequence[FloatArray]) -> float:
        """Return ρ_0 − Σ ⟨X, B_0⟩ of an X for each block: the bound, if the residual is 0."""
        products = sum(
            np.vdot(x, block[0]) for x, block in zip(multipliers, self.blocks, strict=True)
        )
        return float(self.objective[0] - products)

    def dual_residual(self, multipliers: Sequence[FloatArray]) -> FloatArray:
        """Return ρ_j − Σ ⟨X, B_j⟩ for j ≥ 1, shape (moments − 1,)."""
        residual = self.objective[1:].copy()
        for x, block in zip(multipliers, self.blocks, strict=True):
            residual -= block[1:].reshape(len(residual), -1) @ x.ravel()
        return residual


@dataclass(frozen=True, eq=False)
class ConicOutcome:
    """The answer of a solver, unchecked."""

    #: X of each block, symmetric, shape (size, size); None if there is no answer.
    multipliers: tuple[FloatArray, ...] | None
    #: The solver's own word.
    status: str
    #: Number of iterations; None if the solver does not say.
    iterations: int | None = None


def moment_program(
    spaces: Sequence[Sequence[FloatArray]],
    objective: FloatArray,
    *,
    common: Sequence[FloatArray] = (),
    weights: FloatArray | None = None,
) -> MomentProgram:
    """Return the program of an objective and blocks, from their values at configurations.

    Parameters
    ----------
    spaces
        The blocks of each space of functions, each of shape (count, size, size). They are
        sampled at the first `count` of the configurations, which may be fewer in a small space.
        The first space has the objective, and all samples.
    objective
        ρ at all configurations, shape (samples,).
    common
        Blocks whose entries, and 1, span what all spaces share, each of shape (samples, size,
        size). By default they share the constants only.
    weights
        Weights of the configurations, shape (samples,), all 1 by default. The functions e_j of
        each space are orthonormal with them.

    Raises
    ------
    TooFewSamplesError
        If the samples do not distinguish all functions.
    OutsideSpanError
        If an entry or the objective is no combination of the functions.
    """
    # Values at a configuration are multiplied by the root of its weight, so that means with
    # weights are plain inner products.
    weights = np.ones(len(objective)) if weights is None else weights
    roots = np.sqrt(weights / np.mean(weights))
    shared = _completed(common, roots[:, None], roots) if common else roots[:, None]
    counts = [len(blocks[0]) for blocks in spaces]
    bases = [
        _completed(blocks, shared[:count], roots[:count])
        for blocks, count in zip(spaces, counts, strict=True)
    ]
    moments = sum(basis.shape[1] for basis in bases) - (len(bases) - 1) * shared.shape[1]
    goals = np.zeros(moments)
    expanded: list[FloatArray] = []
    start = shared.shape[1]
    for blocks, basis in zip(spaces, bases, strict=True):
        count, own = len(basis), basis.shape[1] - shared.shape[1]
        places = np.r_[: shared.shape[1], start : start + own]
        inverse = np.asarray(np.linalg.pinv(basis), dtype=float)
        if not expanded:
            goals[places] = _coefficients(inverse, basis, roots * objective)
        start += own
        for block in blocks:
            values = roots[:count, None] * block.reshape(count, -1)
            rows = _coefficients(inverse, basis, values).reshape(-1, *block.shape[1:])
            coefficients = np.zeros((moments, *block.shape[1:]))
            coefficients[places] = 0.5 * (rows + rows.transpose(0, 2, 1))
            expanded.append(coefficients)
    return MomentProgram(goals, tuple(expanded))


def _completed(
    blocks: Sequence[FloatArray], known: FloatArray, roots: FloatArray
) -> FloatArray:
    """Return the known functions and others that complete the span, times the `roots`.

    Parameters
    ----------
    blocks
        Blocks whose entries are to be spanned, each of shape (samples, size, size).
    known
        Functions times the roots, shape (samples, known functions).
    roots
        Roots of the weights, shape (samples,).

    Returns
    -------
    FloatArray
        Shape (samples, all functions): the known ones first.
    """
    samples, plain = len(known), np.linalg.qr(known / roots[:, None])[0]
    mixed = _mixed(blocks)
    # Known constants are subtracted first: they are so large that they would cost digits.
    vectors, strengths, _ = np.linalg.svd(mixed - plain @ (plain.T @ mixed))
    rank = int(np.sum(strengths > _RELATIVE_RANK * strengths[0]))
    if rank + known.shape[1] >= samples - 1:
        raise TooFewSamplesError(f"{samples} samples for at least {rank} functions more")
    frame = np.linalg.qr(known)[0]
    others = roots[:, None] * vectors[:, :rank]
    # Twice is enough: the second pass removes what rounding leaves of the first.
    for _ in range(2):
        others -= frame @ (frame.T @ others)
    # Multipliers are sorted by strength: a mixture of strong and weak ones would cost digits.
    return np.hstack([known, np.sqrt(samples) * np.linalg.qr(others)[0]])


def _coefficients(inverse: FloatArray, basis: FloatArray, values: FloatArray) -> FloatArray:
    """Return the coefficients, (functions, …), of what has the `values`, (samples, …).

    `basis` has the shape (samples, functions), and `inverse` is its pseudo-inverse.
    OutsideSpanError if there are no such coefficients.
    """
    found = inverse @ values
    if np.abs(basis @ found - values).max() > _RELATIVE_ERROR * max(
        np.abs(values).max(), _TINY
    ):
        raise OutsideSpanError("an entry or the objective is outside of the span")
    return np.asarray(found)


def _mixed(blocks: Sequence[FloatArray]) -> FloatArray:
    """Return random combinations of the entries of the same span, shape (samples, samples).

    Entries may be many more than samples: their singular values would take longer.
    """
    rng = np.random.default_rng(_SEED)
    samples = len(blocks[0])
    mixed = np.zeros((samples, samples))
    entries = 0
    for block in blocks:
        flat = block.reshape(samples, -1)
        entries += flat.shape[1]
        mixed += flat @ rng.standard_normal((flat.shape[1], samples))
    return np.asarray(mixed / np.sqrt(entries))


def penalised_program(program: MomentProgram, penalty: float) -> MomentProgram:
    """Return the program in which all blocks may fall below 0 together, at a price.

    With one more unknown z, the last one, and a shift s > 0 the program is

        minimise  (ρ_0 + Σ_j ρ_j y_j)/penalty + 1 + z
        subject to  B_0 + Σ_j y_j B_j + s(1 + z)I ⪰ 0 for every block,   1 + z ≥ 0.

    At y = 0, z = 0 the blocks are B_0 + sI: s is so large that no eigenvalue of them is below
    `_INTERIOR`, so that point is an interior one. Multipliers, times the penalty, are
    multipliers of the given program.
    """
    lowest = min(float(np.linalg.eigvalsh(block[0])[0]) for block in program.blocks)
    shift = max(_INTERIOR, _INTERIOR - lowest)
    remaining = np.zeros((program.moments + 1, 1, 1))
    remaining[[0, -1]] = 1.0
    objective = np.append(program.objective, penalty)
    objective[0] += penalty
    units = [shift * np.eye(block.shape[1])[None] for block in program.blocks]
    raised = [
        np.concatenate([block[:1] + unit, block[1:], unit])
        for block, unit in zip(program.blocks, units, strict=True)
    ]
    return MomentProgram(objective / penalty, (*raised, remaining))


def refined_multipliers(
    program: MomentProgram, multipliers: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return multipliers X + Σ z_j X B_j X with smaller dual residuals.

    z, shape (moments − 1,), is such that the residual vanishes: Σ_j ⟨X B_i X, B_j⟩ z_j is what
    is missing in equation i. The changed X are R(I + …)Rᵀ with X = RRᵀ, so they stay positive
    semidefinite as long as changes are small. The equations of z are solved from an orthogonal
    factorisation, which keeps twice as many digits as the matrix of the equations would.
    """
    current = [np.asarray(x) for x in multipliers]
    roots = [semidefinite_root(x) for x in current]
    rows = []
    for root, block in zip(roots, program.blocks, strict=True):
        first, second = np.triu_indices(len(root))
        scaled = (root.T @ block[1:] @ root)[:, first, second]
        # An entry beside the diagonal occurs twice.
        rows.append((scaled * np.where(first == second, 1.0, np.sqrt(2.0))).T)
    # factorᵀ · factor is the matrix of all ⟨X B_i X, B_j⟩. Its columns are scaled to length 1.
    factor = np.linalg.qr(np.vstack(rows), mode="r")
    lengths = np.linalg.norm(factor, axis=0)
    lengths[lengths == 0] = 1.0
    _, strengths, vectors = np.linalg.svd(factor / lengths)
    kept = strengths > _RELATIVE_STRENGTH * strengths[0]
    strengths, vectors = strengths[kept], vectors[: len(kept)][kept]
    residual = program.dual_residual(current)
    for _ in range(_PASSES):
        z = vectors.T @ (vectors @ (residual / lengths) / strengths**2) / lengths
        trial = []
        for x, root, block in zip(current, roots, program.blocks, strict=True):
            change = root.T @ np.tensordot(z, block[1:], axes=1) @ root
            moved = x + root @ change @ root.T
            trial.append(0.5 * (moved + moved.T))
        after = program.dual_residual(trial)
        if np.abs(after).max() >= np.abs(residual).max():
            break
        current, residual = trial, after
    return current
