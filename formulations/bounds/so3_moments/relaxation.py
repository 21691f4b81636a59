"""The steps that all bounds share: sample the blocks, solve the program, collect evidence."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.moment_program import (
    ConicOutcome,
    MomentProgram,
    TooFewSamplesError,
    moment_program,
)
from formulations.bounds.so3_moments.programs.multipliers import (
    identity_leftover,
    nearest_semidefinite,
)
from formulations.bounds.so3_moments.programs.predictor_corrector import (
    solve_with_predictor_corrector,
)
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from nlp.arrays import FloatArray
from nlp.errors import InputError, LockedJointError

Progress: TypeAlias = Callable[[str], None]
PREDICTOR_CORRECTOR = "predictor-corrector"
_LARGEST_JOINTS = 9
_FEW_SAMPLES, _MANY_SAMPLES = 160, 520
# Configurations at which an identity is checked.
FRESH = 40


class SolverFailureError(LockedJointError):
    """The solver gave no multipliers at all."""


def silent(_: str) -> None:
    """Show nothing: the callback for those who want no messages."""


def check_joints(joints: int, smallest: int = 6) -> None:
    """Raise InputError unless `smallest` ≤ n ≤ 9."""
    if joints not in range(smallest, _LARGEST_JOINTS + 1):
        raise InputError("joints", joints, f"an integer from {smallest} to {_LARGEST_JOINTS}")


def residual_values(rotations: FloatArray) -> FloatArray:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F² at rotations (configurations, n, 3, 3)."""
    jacobians = jacobians_of(rotations)
    gram = jacobians @ jacobians.swapaxes(-1, -2)
    # n · I is exact; one division in the precision of the rotations.
    defect = gram - jacobians.shape[-1] * np.eye(6, dtype=gram.dtype) / 3
    return np.asarray(0.5 * np.sum(defect**2, axis=(-1, -2)))


@dataclass(frozen=True, eq=False)
class SolvedRelaxation:
    """A relaxation after the solver, before the check.

    Parameters
    ----------
    families
        Its blocks.
    sampled, program
        The moment program of the residual, and the program that was solved.
    outcome
        The solver's unchecked answer.
    seconds
        Wall time of each phase.
    solved_at
        Reading of the performance counter after the solver, in seconds.
    """

    families: Sequence[BlockFamily]
    sampled: MomentProgram
    program: MomentProgram
    outcome: ConicOutcome
    seconds: Mapping[str, float]
    solved_at: float

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """X of each block as the solver gives it; SolverFailureError if it gives none."""
        if self.outcome.multipliers is None:
            raise SolverFailureError(self.outcome.status)
        return self.outcome.multipliers

    def checked(
        self,
        identity: MomentProgram,
        objective: Callable[[FloatArray], FloatArray],
        fresh: FloatArray,
        how_checked: str,
        *,
        unit_trace: bool = False,
    ) -> tuple[float, Evidence]:
        """Return a bound on an objective after the check of its identity, and the evidence.

        Parameters
        ----------
        identity
            Program whose dual value is the bound.
        objective
            Its values at rotations (configurations, n, 3, 3).
        fresh
            Rotations at which the identity is checked.
        how_checked
            In words.
        unit_trace
            Whether multipliers are scaled to Σ tr X = 1.
        """
        cleaned = [nearest_semidefinite(x) for x in self.multipliers]
        total = sum(float(np.trace(x)) for x in cleaned) if unit_trace else 1.0
        scaled = [x / total for x in cleaned]
        bound = identity.dual_value(scaled)
        leftover = identity_leftover(self.families, scaled, bound, objective, fresh)
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
            size=self.sampled.size,
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
    families: Sequence[BlockFamily],
    joints: int,
    rng: np.random.Generator,
    *,
    adapt: Callable[[MomentProgram], MomentProgram] = lambda program: program,
    gap: float = 1e-9,
    progress: Progress = silent,
) -> SolvedRelaxation:
    """Sample blocks and residual, and solve the moment program.

    Parameters
    ----------
    families
        The blocks.
    joints
        Number n of joints.
    rng
        Source of the sampled configurations.
    adapt
        Returns the program to solve, from the one whose objective is the residual.
    gap
        Relative gap at which the predictor–corrector method stops.
    progress
        Receives a short message at each step.
    """
    clock = [time.perf_counter()]
    sampled = sampled_program(families, joints, rng, progress)
    program = adapt(sampled)
    clock.append(time.perf_counter())
    size = sampled.size
    progress(
        f"solving with {PREDICTOR_CORRECTOR}: {size['moments']} moments, "
        f"{size['blocks']} blocks, the largest {size['largest_block']}"
    )
    outcome = solve_with_predictor_corrector(program, gap=gap, progress=progress)
    clock.append(time.perf_counter())
    seconds = dict(zip(("blocks", "solver"), np.diff(clock).tolist(), strict=True))
    return SolvedRelaxation(families, sampled, program, outcome, seconds, clock[-1])


def sampled_program(
    families: Sequence[BlockFamily], joints: int, rng: np.random.Generator, progress: Progress
) -> MomentProgram:
    """Return the moment program of ρ; more samples until they distinguish all functions."""
    entries = sum(size * (size + 1) // 2 for family in families for size in family.sizes)
    count = _FEW_SAMPLES if entries < 1500 else _MANY_SAMPLES
    while True:
        rotations = random_rotations(rng, count, joints)
        blocks: list[FloatArray] = []
        for number, family in enumerate(families, start=1):
            progress(
                f"evaluating blocks at {count} configurations: {number} of {len(families)}"
            )
            blocks += family.evaluate(rotations)
        try:
            return moment_program(residual_values(rotations), blocks)
        except TooFewSamplesError:
            count *= 2
