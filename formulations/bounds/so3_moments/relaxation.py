"""The steps that all bounds share: sample the blocks, solve the program, check the identity.

    objective(x) − bound = Σ ⟨X, B(x)⟩   for all configurations x, with every X ⪰ 0

proves objective ≥ bound. The largest difference of the two sides at fresh configurations is
subtracted from the bound. That is numerical evidence, no proof: between the configurations
nothing is known.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.moment_program import (
    ConicOutcome,
    MomentProgram,
    TooFewSamplesError,
    margin_program,
    moment_program,
)
from formulations.bounds.so3_moments.predictor_corrector import solve_with_predictor_corrector
from formulations.bounds.so3_moments.sampled_blocks import RowBlocks
from formulations.bounds.so3_moments.wigner import random_rotations, residual_values
from nlp.arrays import FloatArray, nearest_semidefinite
from nlp.errors import InputError, LockedJointError

Progress: TypeAlias = Callable[[str], None]
PREDICTOR_CORRECTOR = "predictor-corrector"
# Configurations at which an identity is checked.
FRESH = 40
_LARGEST_JOINTS = 9
_FEW_SAMPLES, _MANY_SAMPLES = 160, 520


class SolverFailureError(LockedJointError):
    """The solver gave no multipliers at all."""


def silent(_: str) -> None:
    """Show nothing: the callback for those who want no messages."""


def check_joints(joints: int, smallest: int = 6) -> None:
    """Raise InputError unless `smallest` ≤ n ≤ 9."""
    if joints not in range(smallest, _LARGEST_JOINTS + 1):
        raise InputError("joints", joints, f"an integer from {smallest} to {_LARGEST_JOINTS}")


@dataclass(frozen=True, eq=False)
class SolvedRelaxation:
    """A relaxation after the solver, before the check."""

    families: Sequence[RowBlocks]
    #: What objective − bound = Σ ⟨X, B(x)⟩ is about, at rotations (configurations, n, 3, 3),
    #: and the program whose dual value is this bound.
    objective: Callable[[FloatArray], FloatArray]
    identity: MomentProgram
    #: The program that was solved: `identity`, or one whose multipliers have the trace 1.
    program: MomentProgram
    outcome: ConicOutcome
    #: Wall time of each phase, and the performance counter after the solver, in seconds.
    seconds: Mapping[str, float]
    solved_at: float

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """X of each block as the solver gives it; SolverFailureError if it gives none."""
        if self.outcome.multipliers is None:
            raise SolverFailureError(self.outcome.status)
        return self.outcome.multipliers

    def checked(
        self, fresh: FloatArray, how_checked: str, progress: Progress
    ) -> tuple[float, Evidence]:
        """Return a bound on the objective after the check of its identity, and the evidence.

        The bound is the dual value less the largest difference of the identity at fresh
        rotations (configurations, n, 3, 3).
        """
        progress("checking the identity at fresh configurations")
        scaled = [nearest_semidefinite(x) for x in self.multipliers]
        if self.program is not self.identity:
            total = sum(float(np.trace(x)) for x in scaled)
            scaled = [x / total for x in scaled]
        bound = self.identity.dual_value(scaled)
        leftover = identity_leftover(self.families, scaled, bound, self.objective, fresh)
        check = {
            "unchecked_bound": bound,
            "leftover": leftover,
            "fresh_configurations": len(fresh),
        }
        return bound - leftover, self.evidence(how_checked, check, self.multipliers)

    def evidence(
        self,
        how_checked: str,
        check: Mapping[str, Any] | None = None,
        multipliers: Sequence[FloatArray] = (),
        phase: str = "check",
    ) -> Evidence:
        """Return the evidence, with the time since the solver as that of the last phase."""
        residual = self.program.dual_residual(multipliers) if multipliers else None
        lowest = [float(np.linalg.eigvalsh(x)[0]) for x in multipliers]
        return Evidence(
            size=self.identity.size,
            solver=PREDICTOR_CORRECTOR,
            status=self.outcome.status,
            iterations=self.outcome.iterations,
            dual_residual=None if residual is None else float(np.abs(residual).max()),
            smallest_eigenvalue=min(lowest, default=None),
            how_checked=how_checked,
            check=check or {},
            seconds={**self.seconds, phase: time.perf_counter() - self.solved_at},
        )


def solve_relaxation(
    families: Sequence[RowBlocks],
    joints: int,
    rng: np.random.Generator,
    *,
    exclusion: bool = False,
    gap: float = 1e-9,
    progress: Progress = silent,
) -> SolvedRelaxation:
    """Sample the blocks, and solve the moment program of the residual to a relative gap.

    For an exclusion the objective of the identity is 0, and the program solved is that of the
    largest s such that every block is ⪰ sI.
    """
    clock = [time.perf_counter()]
    identity = _sampled_program(families, joints, rng, progress)
    program, objective = identity, residual_values
    if exclusion:
        identity = replace(identity, objective=np.zeros(identity.moments))
        program, objective = margin_program(identity), _zero
    clock.append(time.perf_counter())
    size = identity.size
    progress(
        f"solving with {PREDICTOR_CORRECTOR}: {size['moments']} moments, "
        f"{size['blocks']} blocks, the largest {size['largest_block']}"
    )
    outcome = solve_with_predictor_corrector(program, gap=gap, progress=progress)
    clock.append(time.perf_counter())
    seconds = phases(clock)
    return SolvedRelaxation(families, objective, identity, program, outcome, seconds, clock[-1])


def phases(clock: Sequence[float]) -> dict[str, float]:
    """Return the seconds for the blocks and the solver, from the times between them."""
    return dict(zip(("blocks", "solver"), np.diff(clock).tolist(), strict=True))


def _zero(rotations: FloatArray) -> FloatArray:
    return np.zeros(len(rotations))


def _sampled_program(
    families: Sequence[RowBlocks], joints: int, rng: np.random.Generator, progress: Progress
) -> MomentProgram:
    """Return the moment program of ρ; more samples until they distinguish all functions."""
    entries = sum(size * (size + 1) // 2 for family in families for size in family.sizes)
    count = _FEW_SAMPLES if entries < 1500 else _MANY_SAMPLES
    while True:
        rotations = random_rotations(rng, count, joints)
        blocks = evaluated(families, rotations, progress)
        try:
            return moment_program([blocks], residual_values(rotations))
        except TooFewSamplesError:
            count *= 2


def evaluated(
    families: Sequence[RowBlocks], rotations: FloatArray, progress: Progress = silent
) -> list[FloatArray]:
    """Return all blocks at rotations (configurations, n, 3, 3)."""
    blocks: list[FloatArray] = []
    for number, family in enumerate(families, start=1):
        progress(
            f"evaluating blocks at {len(rotations)} configurations: {number} of {len(families)}"
        )
        blocks += family.evaluate(rotations)
    return blocks


def identity_leftover(
    families: Sequence[RowBlocks],
    multipliers: Sequence[FloatArray],
    bound: float,
    objective: Callable[[FloatArray], FloatArray],
    fresh: FloatArray,
) -> float:
    """Return the largest difference of the two sides of the identity at fresh rotations.

    These are configurations that were not used to find the multipliers, which are positive
    semidefinite and in the order of the families.
    """
    blocks = (block for family in families for block in family.evaluate(fresh))
    squares = np.zeros(len(fresh))
    for x, block in zip(multipliers, blocks, strict=True):
        squares += np.tensordot(block, x, axes=2)
    return float(np.abs(objective(fresh) - bound - squares).max())
