"""From blocks to a bound: sample, solve, and write the certificate.

    objective(x) − bound = Σ ⟨X, B(x)⟩   for all configurations x, with every X ⪰ 0

proves objective ≥ bound. The squares go to a file (`certificate`), and what is reported is what
`verification` proves from its text.

- x: a configuration, the rotations of n joints, shape (n, 3, 3); nothing has a unit;
- objective: a function of x; the residual ρ by default. For the worst case it is that of
  `exclude_with_signs` in `unit_revolute_bounds`;
- family: the blocks B(x) of one sector, of squares or of a condition, see `BlockFamily`;
- X: the multiplier of a block, shape (size, size), as B(x). X = LLᵀ, L its factor;
- bound, also constant or dual value: the number that the multipliers prove but for rounding;
- U, P and pivots i: see `certificate`;
- max-min: the worst case σ after one locked joint; t, `excluded`: what σ² does not reach.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from fractions import Fraction
from math import floor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg

from lockedjoint.formulations.bounds.moments.certificate import (
    BlockSquares,
    BoundCertificate,
    CertifiedQuantity,
    SectorSquares,
)
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.bounds.moments.enclosed_matrix import require_extended_precision
from lockedjoint.formulations.bounds.moments.moment_program import (
    ConicOutcome,
    MomentProgram,
    TooFewSamplesError,
    moment_program,
    penalised_program,
    refined_multipliers,
)
from lockedjoint.formulations.bounds.moments.rotations import random_rotations, residual_values
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.solvers import DENSE, solve_moments
from lockedjoint.formulations.bounds.moments.symmetric_rows import AdaptedRows
from lockedjoint.formulations.bounds.moments.tableaux import Shapes, first_tableau
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from lockedjoint.formulations.bounds.rational_roots import root_above
from lockedjoint.formulations.bounds.revolute_exclusions import (
    excludes_isotropic_levers,
    least_excluded,
)
from lockedjoint.formulations.bounds.spectral_limit import Spectrum
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.io.files import prepare_file, write_text
from lockedjoint.nlp.arrays import FloatArray, semidefinite_root
from lockedjoint.nlp.errors import LockedJointError
from lockedjoint.nlp.progress import Step, part_of

#: It is called with a sentence, or a `Step`, on how far the work is.
Progress: TypeAlias = Callable[[str], None]
# Number of configurations at which blocks with few entries are first sampled. If it is too
# small for the functions it is doubled; if it is too large the work takes longer.
_FEW_SAMPLES = 160
# Number of entries of all blocks from which there are more configurations.
_FEW_ENTRIES = 1500
# Number of configurations for blocks with more entries: 476 functions and some more.
_MANY_SAMPLES = 520
# Relative gap at which the solver stops. Multipliers are then well inside of the cone, and can
# be made to satisfy the equations to the last digits.
_GAP = 3e-8
# Accuracy of the dual equations at which the solver of a penalised program stops, in units of
# the penalty. A smaller one may never be reached.
_ACCURACY = 1e-9
# Singular value of a basis, relative to the largest, below which it counts as 0.
_RELATIVE_RANK = 1e-6
# Answer to ``how_checked`` in the tables.
_HOW_VERIFIED = (
    "certificate verified from its file: a sum of squares or localisers by construction; its "
    "difference from what it should be is an invariant polynomial, bounded everywhere by its "
    "values at points, all rounding bounded"
)
# Bound that a certificate of the residual states before it is verified: it says nothing, as
# ρ ≥ 0.
_NOTHING = -1.0
# Share of the defect δ that is taken off once more before a bound is stated: on other machines
# δ may be larger by so much.
_SHARE_OF_DEFECT = 0.1
# Number of decimal digits to which a bound is rounded down.
_DIGITS = 8
# Share of a whole search that is done when blocks are evaluated.
EVALUATED = 0.38
# Share that is done when the program is solved.
SOLVED = 0.63


class SolverFailureError(LockedJointError):
    """The solver gave no multipliers at all."""


def isotropic_limit(defect: float, joints: int) -> float:
    """Return a σ that no isotropic arm reaches, from a lower bound of `lever_defect`."""
    return least_excluded(excludes_isotropic_levers, defect, joints)


def silent(_: str) -> None:
    """Show nothing: the callback for those who want no messages."""


def prepare_proof(out: Path | None) -> None:
    """Refuse, before any work, a machine without extended precision or an impossible file."""
    require_extended_precision()
    prepare_file(out)


@dataclass(frozen=True, eq=False)
class SolvedRelaxation:
    """A relaxation after the solver, before the check."""

    #: The blocks, in the order of the program.
    families: Sequence[BlockFamily]
    #: Its dual value is the bound.
    program: MomentProgram
    #: What the solver answers.
    outcome: ConicOutcome
    #: The performance counter at the start, after the blocks, and after the solver, in seconds.
    clock: Sequence[float]

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """X of each block as the solver gives it; SolverFailureError if it gives none."""
        if self.outcome.multipliers is None:
            raise SolverFailureError(self.outcome.status)
        return self.outcome.multipliers

    def refined(self) -> SolvedRelaxation:
        """Return it with multipliers that satisfy the equations to the last digits."""
        found = tuple(refined_multipliers(self.program, self.multipliers))
        return replace(self, outcome=replace(self.outcome, multipliers=found))

    def proved(
        self,
        joints: int,
        progress: Progress,
        out: Path | None,
        executor: Executor | None = None,
        *,
        quantity: CertifiedQuantity = "residual",
        excluded: float | None = None,
        spectrum: Spectrum | None = None,
        once: Sequence[BlockFamily] = (),
    ) -> tuple[float, dict[str, Any]]:
        """Write the certificate to a file, verify it from there, and return what it states.

        That is √`excluded`, or a little less than what was proved: elsewhere rounding may be
        worse.

        Parameters
        ----------
        joints
            n.
        progress
            Is told how far the verification is.
        out
            Where the certificate is written to, if anywhere.
        executor
            Where it is verified, by default in this process.
        quantity
            What is bounded.
        excluded, spectrum
            t, and A, B and C of `spectral_limit`, for max-min.
        once
            Blocks with one row whose multiplier is 1: they are no part of the program.

        Returns
        -------
        tuple
            The stated bound, and the evidence for tables: ``size`` of the program, ``status``
            and ``iterations`` of the solver, ``dual_residual`` (largest error of the equations)
            and ``smallest_eigenvalue`` of its multipliers, ``how_checked``, ``check`` (numbers
            of the proof) and ``seconds`` of each step.

        Raises
        ------
        SolverFailureError
            If there are no multipliers.
        CertificateError
            If `excluded` is not excluded, or the verification fails.
        """
        multipliers = self.multipliers
        constant = self.program.dual_value(multipliers)
        if excluded is not None and constant <= 0:
            raise CertificateError(f"σ² ≥ {excluded} is not excluded: there is no certificate.")
        if excluded is not None:
            stated = root_above(Fraction(excluded))
        else:
            stated = _NOTHING if quantity == "residual" else isotropic_limit(0.0, joints)
        certificate = search_certificate(
            [*self.families, *once],
            [*multipliers, *([np.eye(1)] * len(once))],
            constant,
            stated,
            joints,
            quantity,
            excluded,
            spectrum,
        )
        with TemporaryDirectory() as folder:
            path = Path(folder) / "bound.json"
            path.write_text(certificate.to_json(), encoding="utf-8")
            last = part_of(progress, SOLVED, 1.0)
            verified = verify_bound(read_any(path), executor=executor, progress=last)
        if excluded is None:
            defect = verified.check["defect"]
            surely = constant - (1 + _SHARE_OF_DEFECT) * defect
            stated = floor(surely * 10**_DIGITS) / 10**_DIGITS
            if quantity == "isotropy":
                stated = isotropic_limit(max(0.0, stated), joints)
        if out is not None:
            write_text(out, replace(certificate, bound=stated).to_json())
        check = {"constant": constant, "verified": verified.bound, **verified.check}
        times = np.diff([*self.clock, time.perf_counter()]).tolist()
        return stated, {
            "size": self.program.size,
            "status": self.outcome.status,
            "iterations": self.outcome.iterations,
            "dual_residual": float(np.abs(self.program.dual_residual(multipliers)).max()),
            "smallest_eigenvalue": min(float(np.linalg.eigvalsh(x)[0]) for x in multipliers),
            "how_checked": _HOW_VERIFIED,
            "check": check,
            "seconds": dict(zip(("blocks", "solver", "verification"), times, strict=True)),
        }


def solve_relaxation(
    families: Sequence[BlockFamily],
    joints: int,
    rng: np.random.Generator,
    *,
    objective: Callable[[FloatArray], FloatArray] = residual_values,
    penalty: float | None = None,
    solver: str = DENSE,
    gap: float = _GAP,
    progress: Progress = silent,
) -> SolvedRelaxation:
    """Sample the blocks, and solve the moment program of an objective to a relative gap.

    Parameters
    ----------
    families
        The blocks.
    joints
        n.
    rng
        What makes the configurations.
    objective
        The function of rotations, shape (configurations, n, 3, 3), that is bounded from below.
    penalty
        The price for blocks below 0, see `penalised_program`; None if they may not be. Blocks
        of conditions that are not positive at the mean need one.
    solver
        A name of `solvers`.
    gap
        The relative gap at which the solver stops, in units of the penalty if there is one.
    progress
        Is told how far the work is.
    """
    clock = [time.perf_counter()]
    entries = sum(size * (size + 1) // 2 for family in families for size in family.sizes)
    count = _FEW_SAMPLES if entries < _FEW_ENTRIES else _MANY_SAMPLES
    # The loop ends when the samples distinguish all functions, which are finitely many.
    while True:
        rotations = random_rotations(rng, count, joints)
        blocks = evaluated(families, rotations, part_of(progress, 0.0, EVALUATED))
        try:
            program = moment_program([blocks], objective(rotations))
            break
        except TooFewSamplesError:
            count *= 2
    clock.append(time.perf_counter())
    tell = part_of(progress, EVALUATED, SOLVED)
    tell(f"solving: {program.size}")
    if penalty is None:
        outcome = solve_moments(program, solver, gap=gap, progress=tell)
    else:
        outcome = solve_penalised(program, penalty, solver, gap=gap, progress=tell)
    clock.append(time.perf_counter())
    return SolvedRelaxation(families, program, outcome, clock)


def solve_penalised(
    program: MomentProgram,
    penalty: float,
    solver: str,
    *,
    gap: float,
    accuracy: float = _ACCURACY,
    progress: Progress = silent,
) -> ConicOutcome:
    """Solve a program in which all blocks may fall below 0 together, at a price.

    The gap and the accuracy are in units of the penalty. Multipliers are those of the given
    program: the last block of `penalised_program` is left out.
    """
    outcome = solve_moments(
        penalised_program(program, penalty),
        solver,
        gap=gap,
        accuracy=accuracy,
        progress=progress,
    )
    if outcome.multipliers is None:
        return outcome
    return replace(outcome, multipliers=tuple(penalty * x for x in outcome.multipliers[:-1]))


def evaluated(
    families: Sequence[BlockFamily], rotations: FloatArray, progress: Progress
) -> list[FloatArray]:
    """Return the values of all blocks, each of shape (configurations, size, size).

    `rotations` has the shape (configurations, n, 3, 3).
    """
    blocks: list[FloatArray] = []
    for number, family in enumerate(families):
        progress(
            Step(f"{number} of {len(families)} families of blocks", number / len(families))
        )
        blocks += family.evaluate(rotations)
    return blocks


def search_certificate(
    families: Sequence[BlockFamily],
    multipliers: Sequence[FloatArray],
    constant: float,
    bound: float,
    joints: int,
    quantity: CertifiedQuantity = "residual",
    excluded: float | None = None,
    spectrum: Spectrum | None = None,
) -> BoundCertificate:
    """Return the certificate of a bound, from multipliers X of the blocks B of a search.

    They make objective(x) − `constant` = Σ ⟨X, B(x)⟩; where t is `excluded` the objective is 0.
    `multipliers` has one X, shape (size, size), for each block of each family. `bound` is what
    the file states, and `quantity` what it bounds.
    """
    parts: dict[str, list[SectorSquares]] = {}
    remaining = iter(multipliers)
    for family in families:
        squares = _squares(family, [next(remaining) for _ in family.blocks])
        parts.setdefault(family.name, []).extend(squares)
    return BoundCertificate(
        quantity,
        joints,
        bound,
        constant,
        {name: tuple(squares) for name, squares in parts.items()},
        excluded,
        spectrum,
    )


def _squares(family: BlockFamily, multipliers: Sequence[FloatArray]) -> list[SectorSquares]:
    """Return the sector of a family with its squares; an empty list if all X are 0.

    `multipliers` are the X of its blocks, shape (size, size) each.
    """
    # Blocks that are even and odd under conjugation share what belongs to the first tableau.
    together: dict[tuple[Shapes, int], list[FloatArray]] = {}
    for block in family.blocks:
        for number, _, coefficients in block.parts:
            first = coefficients[first_tableau(block.shapes)]
            together.setdefault((block.shapes, number), []).append(first)
    frames = {key: _frame(np.hstack(parts)) for key, parts in together.items()}
    blocks = []
    for block, multiplier in zip(family.blocks, multipliers, strict=True):
        root = semidefinite_root(multiplier)
        factor = root[:, root.any(axis=0)]
        if factor.size:
            own = {number: frames[block.shapes, number] for number, _, _ in block.parts}
            blocks.append(_block_squares(family, block, factor, own))
    return [(family.sector, tuple(blocks))] if blocks else []


def _frame(basis: FloatArray) -> tuple[tuple[int, ...], FloatArray]:
    """Return pivots i, and the left inverse of the columns P e_i, shape (pivots, plain rows).

    P is the projector on the span of the columns of `basis`, shape (plain rows, columns), and
    the P e_i are a basis of it: pivoted QR chooses them as independent as it can.
    """
    vectors, values, _ = np.linalg.svd(basis, full_matrices=False)
    vectors = vectors[:, values > _RELATIVE_RANK * values[0]]
    order = scipy.linalg.qr(vectors.T, mode="r", pivoting=True)[1]
    pivots = sorted(int(i) for i in order[: vectors.shape[1]])
    # P is vectors · vectorsᵀ: so P e_i is vectors times row i of vectors, transposed.
    return tuple(pivots), np.linalg.inv(vectors[pivots].T) @ vectors.T


def _block_squares(
    family: BlockFamily,
    block: AdaptedRows,
    factor: FloatArray,
    frames: Mapping[int, tuple[tuple[int, ...], FloatArray]],
) -> BlockSquares:
    """Return the same squares with P e_i in place of the block's own rows.

    `factor` is L, shape (rows of the block, squares). `frames` has pivots and left inverse of
    `_frame` by the number of the label set. The change of basis from the block's rows to the
    columns P e_i is applied to the part of L that belongs to each vector w_a.
    """
    start = first_tableau(block.shapes)
    changes = {n: np.zeros((len(pivots), block.size)) for n, (pivots, _) in frames.items()}
    for number, place, coefficients in block.parts:
        changes[number][:, place] += frames[number][1] @ coefficients[start]
    rows = {family.rows[number].group_labels: pivots for number, (pivots, _) in frames.items()}
    change = np.vstack(list(changes.values()))
    # Rows of L before and after the change, with the number a of the vector w_a of each.
    before, vector_before = family.selection(block)
    squares = BlockSquares(block.shapes, rows, change)
    after, vector_after = squares.selection(family)
    parts = []
    for a in range(len(family.lowered)):
        own = np.zeros((block.size, factor.shape[1]))
        own[before[vector_before == a]] = factor[vector_before == a]
        parts.append((change @ own)[after[vector_after == a]])
    return replace(squares, factor=np.vstack(parts))
