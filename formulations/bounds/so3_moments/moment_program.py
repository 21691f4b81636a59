"""The semidefinite program in the pseudo-moments, from values at sampled configurations.

Invariant functions are known by their values at the samples. In an orthonormal basis e_0 = 1,
e_1, … of their span, a linear functional with L(1) = 1 is a vector y of its values at e_1, …:

    minimise  ρ_0 + Σ_j ρ_j y_j   subject to   B_0 + Σ_j y_j B_j ⪰ 0 for every block,

where B_j holds the coefficients of e_j of the entries. Multipliers X ⪰ 0 of the blocks with
Σ ⟨X, B_j⟩ = ρ_j for j ≥ 1 prove the bound ρ_0 − Σ ⟨X, B_0⟩.

A margin program has the largest s with every block ⪰ sI as its solution; s is negative where
the conditions cannot all be met.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nlp.arrays import FloatArray
from nlp.errors import LockedJointError

_RELATIVE_RANK = 1e-8
# Functions that are small where samples concentrate have ratios down to 3e-8; rounding, 1e-15.
_WEIGHTED_RANK = 1e-10
_SEED = 7


class TooFewSamplesError(LockedJointError):
    """The samples do not distinguish all functions: more are needed."""


class OutsideSpanError(LockedJointError):
    """The objective is no combination of the entries of the blocks."""


@dataclass(frozen=True, eq=False)
class MomentProgram:
    """Blocks and objective as functions of the pseudo-moments."""

    #: ρ_0, ρ_1, …, shape (moments,).
    objective: FloatArray
    #: For each block B_0, B_1, …, shape (moments, size, size).
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

    def congruent(self, transforms: Sequence[FloatArray]) -> "MomentProgram":
        """Return the program with TᵀBT for each block B."""
        blocks = (t.T @ block @ t for t, block in zip(transforms, self.blocks, strict=True))
        return MomentProgram(self.objective, tuple(blocks))

    def dual_value(self, multipliers: Sequence[FloatArray]) -> float:
        """Return ρ_0 − Σ ⟨X, B_0⟩."""
        products = sum(
            np.vdot(x, block[0]) for x, block in zip(multipliers, self.blocks, strict=True)
        )
        return float(self.objective[0] - products)

    def dual_residual(self, multipliers: Sequence[FloatArray]) -> FloatArray:
        """Return ρ_j − Σ ⟨X, B_j⟩ for j ≥ 1."""
        residual = self.objective[1:].copy()
        for x, block in zip(multipliers, self.blocks, strict=True):
            residual -= block[1:].reshape(len(residual), -1) @ x.ravel()
        return residual


@dataclass(frozen=True, eq=False)
class ConicOutcome:
    """The answer of a solver, unchecked."""

    #: y_1, y_2, …, and X of each block, symmetric; None if there is no answer.
    moments: FloatArray | None
    multipliers: tuple[FloatArray, ...] | None
    status: str
    iterations: int | None = None


def moment_program(values: FloatArray, blocks: Sequence[FloatArray]) -> MomentProgram:
    """Return the program of an objective, (samples,), and blocks, (samples, size, size).

    Raises
    ------
    TooFewSamplesError
        If there might be as many independent functions as samples.
    OutsideSpanError
        If the objective is not in the span of the entries.
    """
    samples = len(values)
    basis = _orthonormal_functions(blocks)
    objective = basis.T @ values / samples
    if np.abs(basis @ objective - values).max() > 1e-8 * np.abs(values).max():
        raise OutsideSpanError("the objective is outside of the span of the blocks' entries")
    return MomentProgram(objective, tuple(_expanded(block, basis) for block in blocks))


def joined_program(
    spaces: Sequence[Sequence[FloatArray]],
    common: Sequence[FloatArray],
    *,
    weights: FloatArray,
    objective: FloatArray,
) -> MomentProgram:
    """Return a program of blocks from several spaces of functions.

    What the spaces share is the span of the entries of the blocks `common`. Each block,
    (samples, size, size), depends on the unknowns of its own space only, which the solver makes
    use of. The samples of the other spaces are the first ones of the first space. Functions are
    orthonormal with respect to the positive weights of the samples. The objective is a function
    of the first space. Raises what `moment_program` raises.
    """
    roots = np.sqrt(weights / np.mean(weights))
    shared = _completed(common, roots[:, None], roots)
    counts = [len(blocks[0]) for blocks in spaces]
    bases = [
        _completed(blocks, shared[:count], roots[:count])
        for blocks, count in zip(spaces, counts, strict=True)
    ]
    own = [basis.shape[1] - shared.shape[1] for basis in bases]
    moments = shared.shape[1] + sum(own)
    goals = np.zeros(moments)
    expanded = []
    for number, (blocks, basis) in enumerate(zip(spaces, bases, strict=True)):
        inverse = np.asarray(np.linalg.pinv(basis), dtype=float)
        places = np.arange(basis.shape[1])
        places[shared.shape[1] :] += sum(own[:number])
        if number == 0:
            goals[places] = _coefficients(inverse, basis, roots * objective)
        for block in blocks:
            count, size = block.shape[:2]
            values = roots[:count, None] * block.reshape(count, -1)
            rows = _coefficients(inverse, basis, values).reshape(-1, size, size)
            coefficients = np.zeros((moments, size, size))
            coefficients[places] = 0.5 * (rows + rows.transpose(0, 2, 1))
            expanded.append(coefficients)
    return MomentProgram(goals, tuple(expanded))


def _completed(
    blocks: Sequence[FloatArray], known: FloatArray, roots: FloatArray
) -> FloatArray:
    """Return the known functions and others that complete the span of the entries.

    All values, (samples, functions), are times the roots of the weights.
    """
    samples = len(known)
    single = (known / roots[:, None]).T[:, :, None, None]
    vectors, strengths, _ = np.linalg.svd(_mixed([*blocks, *single]))
    rank = int(np.sum(strengths > _WEIGHTED_RANK * strengths[0]))
    if rank >= samples - 1:
        raise TooFewSamplesError(f"{samples} samples for at least {rank} functions")
    frame = np.linalg.qr(known)[0]
    others = roots[:, None] * vectors[:, :rank]
    for _ in range(2):
        others -= frame @ (frame.T @ others)
    left = np.linalg.svd(others, full_matrices=False)[0][:, : rank - known.shape[1]]
    return np.hstack([known, np.sqrt(samples) * left])


def _coefficients(inverse: FloatArray, basis: FloatArray, values: FloatArray) -> FloatArray:
    """Return the coefficients of functions with these values; OutsideSpanError if none."""
    found = inverse @ values
    if np.abs(basis @ found - values).max() > 1e-8 * max(np.abs(values).max(), 1e-300):
        raise OutsideSpanError("an entry or the objective is outside of the span")
    return np.asarray(found)


def penalised_program(program: MomentProgram, penalty: float) -> MomentProgram:
    """Return the program in which all blocks may fall below 0 together, at a price.

    The penalty is the price of a multiple of the unit matrix in all blocks. The program has one
    more unknown, the last, and one more block; y = 0 is an interior point; the objective is
    divided by the penalty. Its multipliers, times the penalty and without the last one, are
    multipliers of the given program, with a value at most as good; the same value if the
    penalty is large enough.
    """
    lowest = min(float(np.linalg.eigvalsh(block[0])[0]) for block in program.blocks)
    shift = max(0.1, 0.1 - lowest)
    blocks = []
    for block in program.blocks:
        unit = shift * np.eye(block.shape[1])[None]
        blocks.append(np.concatenate([block[:1] + unit, block[1:], unit]))
    remaining = np.zeros((program.moments + 1, 1, 1))
    remaining[[0, -1]] = 1.0
    objective = np.append(program.objective, penalty)
    objective[0] += penalty
    return MomentProgram(objective / penalty, (*blocks, remaining))


def _expanded(block: FloatArray, basis: FloatArray) -> FloatArray:
    """Return the coefficients of a block's entries, (functions, size, size), symmetric."""
    samples, size = block.shape[:2]
    found = (basis.T / samples @ block.reshape(samples, -1)).reshape(-1, size, size)
    return np.asarray(0.5 * (found + found.transpose(0, 2, 1)))


def margin_program(program: MomentProgram) -> MomentProgram:
    """Return the program whose smallest value is −s; the objective of the given one is left.

    Multipliers X ⪰ 0 with Σ tr X = 1 and Σ ⟨X, B(x)⟩ = d for all x prove s ≤ d; if d < 0, no
    configuration meets the conditions, for Σ ⟨X, B(x)⟩ would not be negative there. The one
    more unknown, the last, is s plus a shift that makes y = 0 an interior point.
    """
    lowest = min(float(np.linalg.eigvalsh(block[0])[0]) for block in program.blocks)
    shift = max(0.0, 1.0 - lowest)
    blocks = []
    for block in program.blocks:
        unit = np.eye(block.shape[1])[None]
        blocks.append(np.concatenate([block[:1] + shift * unit, block[1:], -unit]))
    objective = np.zeros(program.moments + 1)
    objective[0], objective[-1] = shift, -1.0
    return MomentProgram(objective, tuple(blocks))


def _orthonormal_functions(blocks: Sequence[FloatArray]) -> FloatArray:
    """Return an orthonormal basis of the functions at the samples, the constant first."""
    mixed = _mixed(blocks)
    samples = len(mixed)
    constant = np.ones((samples, 1))
    vectors, strengths, _ = np.linalg.svd(mixed - constant @ (constant.T @ mixed / samples))
    rank = int(np.sum(strengths > _RELATIVE_RANK * strengths[0]))
    if rank >= samples - 2:
        raise TooFewSamplesError(f"{samples} samples for at least {rank} functions")
    return np.hstack([constant, np.sqrt(samples) * vectors[:, :rank]])


def _mixed(blocks: Sequence[FloatArray]) -> FloatArray:
    """Return as many random combinations of the entries as samples, (samples, samples).

    They have the same span as the entries and are fewer.
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
