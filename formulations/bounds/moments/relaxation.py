"""From blocks to a bound: sample, solve, and write the certificate.

    objective(x) − bound = Σ ⟨X, B(x)⟩   for all configurations x, with every X ⪰ 0

proves objective ≥ bound. The squares go to a file (`certificate`), and what is reported is what
`verification` proves from its text.
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

Progress: TypeAlias = Callable[[str], None]
# Number of configurations at which blocks with few entries are first sampled.
_FEW_SAMPLES = 160
# Number of entries of all blocks from which there are more configurations.
_FEW_ENTRIES = 1500
# Number of configurations for blocks with more entries.
_MANY_SAMPLES = 520
# Relative gap at which the solver stops. Multipliers are then well inside of the cone, and can
# be made to satisfy the equations to the last digits.
_GAP = 3e-8
# Singular value of a basis, relative to the largest, below which it counts as 0.
_RANK = 1e-6
_HOW_VERIFIED = (
    "certificate verified from its file: a sum of squares or localisers by construction; its "
    "difference from what it should be is an invariant polynomial, bounded everywhere by its "
    "values at points, all rounding bounded"
)
# Bound that a certificate of the residual states before it is verified: it says nothing, as
# ρ ≥ 0.
_NOTHING = -1.0
# Share of the defect δ that is taken off what was proved, and the digits to which the result is
# rounded down.
_SHARE_OF_DEFECT = 0.1
_DIGITS = 8
# Share of a whole search that is done when blocks are evaluated.
EVALUATED = 0.38
# Share that is done when the program is solved.
SOLVED = 0.63


class SolverFailureError(LockedJointError):
    """The solver gave no multipliers at all."""


def isotropic_limit(defect: float, joints: int) -> float:
    """Return a worst case that no isotropic arm reaches, from a proved `lever_defect`."""
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

    families: Sequence[BlockFamily]
    #: Its dual value is the bound.
    program: MomentProgram
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
        worse. Blocks that the certificate has `once` have the multiplier 1.
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

    By default of the residual. Localisers that are not positive at the mean need a `penalty`.
    """
    clock = [time.perf_counter()]
    entries = sum(size * (size + 1) // 2 for family in families for size in family.sizes)
    count = _FEW_SAMPLES if entries < _FEW_ENTRIES else _MANY_SAMPLES
    while True:  # until the samples distinguish all functions
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
    accuracy: float = 1e-9,
    progress: Progress = silent,
) -> ConicOutcome:
    """Solve a program in which all blocks may fall below 0 together, at a price.

    The gap and the accuracy are in units of the penalty; multipliers are of the given program.
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
    """Return all blocks at rotations (configurations, n, 3, 3)."""
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

    They make ρ − `constant` = Σ ⟨X, B(x)⟩, or that of another objective than ρ; where t is
    `excluded`, −`constant` = Σ ⟨X, B(x)⟩.
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
    """Return the squares of a family, nothing if all its multipliers are 0."""
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
    """Return pivots i, and the left inverse of the P e_i, P on the span of the columns."""
    vectors, values, _ = np.linalg.svd(basis, full_matrices=False)
    vectors = vectors[:, values > _RANK * values[0]]
    order = scipy.linalg.qr(vectors.T, mode="r", pivoting=True)[1]
    pivots = sorted(int(i) for i in order[: vectors.shape[1]])
    # P = vectors · vectorsᵀ.
    return tuple(pivots), np.linalg.inv(vectors[pivots].T) @ vectors.T


def _block_squares(
    family: BlockFamily,
    block: AdaptedRows,
    factor: FloatArray,
    frames: Mapping[int, tuple[tuple[int, ...], FloatArray]],
) -> BlockSquares:
    """Return the same squares with P e_i in place of the block's own rows."""
    start = first_tableau(block.shapes)
    changes = {n: np.zeros((len(pivots), block.size)) for n, (pivots, _) in frames.items()}
    for number, place, coefficients in block.parts:
        changes[number][:, place] += frames[number][1] @ coefficients[start]
    rows = {family.rows[number].group_labels: pivots for number, (pivots, _) in frames.items()}
    change = np.vstack(list(changes.values()))
    # The rows of the factor of a localiser are those of r_0, r_1 and r_2.
    chosen, powers = family.selection(block)
    squares = BlockSquares(block.shapes, rows, change)
    allowed, by_power = squares.selection(family)
    parts = []
    for power in range(len(family.lowered)):
        own = np.zeros((block.size, factor.shape[1]))
        own[chosen[powers == power]] = factor[powers == power]
        parts.append((change @ own)[allowed[by_power == power]])
    return replace(squares, factor=np.vstack(parts))
