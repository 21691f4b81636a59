"""One start of a search for a posture: how it is drawn, and what it came to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formulations import catalogue, measures
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray
from nlp.multistart import Run

# A start is the best of so many random configurations: a robot has many poor optima, and
# near-singular postures from which max-min hardly moves.
DRAWS = 64


@dataclass(frozen=True, eq=False)
class Candidate:
    """What one start came to, measured from J at the posture alone.

    Attributes
    ----------
    index
        Number of the start.
    return_status
        Ipopt's own account.
    merit
        What the formulation optimises; NaN if the posture does not satisfy it.
    worst_case_sigma
        Eq. (5).
    configuration
        Positions, within the limits, shape (n,).
    """

    index: int
    return_status: str
    merit: float
    worst_case_sigma: float
    configuration: FloatArray


class PromisingStart:
    """Draws configurations at random and keeps the one with the best worst case."""

    def __init__(self, arm: RobotArm, locked: int = 1, draws: int = DRAWS) -> None:
        self.arm, self.locked, self.draws = arm, locked, draws

    def __call__(self, rng: np.random.Generator) -> FloatArray:
        """Draw a start."""
        drawn = [self.arm.sample(rng) for _ in range(self.draws)]
        return max(drawn, key=self._worst_case)

    def _worst_case(self, point: FloatArray) -> float:
        return measures.worst_case_sigma(self.arm.jacobian(point), self.locked)


def judge(run: Run, arm: RobotArm, formulation: str, locked: int = 1) -> Candidate:
    """Measure the posture that a start came to, brought within the limits."""
    lower, upper = arm.bounds
    point = run.solution.variables[: arm.size]
    finite = bool(np.all(np.isfinite(point)))
    merit = sigma = float("nan")
    if finite:
        point = np.clip(_unwound(arm, point), lower, upper)
        matrix = arm.jacobian(point)
        merit = catalogue.formulation(formulation).merit(matrix, locked)
        sigma = measures.worst_case_sigma(matrix, locked)
    return Candidate(
        index=run.index,
        return_status=run.solution.status.return_status,
        merit=merit if np.isfinite(merit) else float("nan"),
        worst_case_sigma=sigma,
        configuration=point,
    )


def _unwound(arm: RobotArm, point: FloatArray) -> FloatArray:
    """Positions of joints without limits in [−π, π)."""
    lower, upper = arm.bounds
    endless = ~np.isfinite(lower) & ~np.isfinite(upper) & ~np.array(arm.chain.prismatic)
    return np.where(endless, (point + np.pi) % (2 * np.pi) - np.pi, point)
