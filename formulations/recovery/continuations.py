"""What a controller has at hand before a failure: for each joint and sample, how to go on."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np

from formulations.clearance.link_clearance import LinkClearance
from formulations.clearance.motion import ClearMotion
from formulations.kinematics.forward import Kinematics
from formulations.paths.plan import PathPlan
from formulations.paths.survival import survivors
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Continuations:
    """How a planned path is finished after each failure that it survives.

    Attributes
    ----------
    joints, times
        Names of the n joints; seconds of the N samples.
    configurations
        Radians or metres, shape (n, N, N, n): if joint f locks at sample k, the arm is at
        ``configurations[f, k, i]`` at sample i ≥ k; NaN before, and where f is not survived.
        At i = k it is where the arm was, or another point of the self-motion of that pose,
        to which it has to move first.
    """

    joints: tuple[str, ...]
    times: FloatArray
    configurations: FloatArray

    @classmethod
    def of(
        cls,
        arm: RobotArm,
        plan: PathPlan,
        seed: int = 0,
        clearance: LinkClearance | None = None,
    ) -> Continuations:
        """Return those of a plan, with the seed and the clearance of its search."""
        q = plan.planned.configurations
        count, n = q.shape
        tracks = np.full((n, count, count, n), np.nan)
        kinematics = Kinematics(arm.chain, arm.task.rows)
        allowed = None if clearance is None else ClearMotion(clearance, arm.chain).clear
        given = kinematics, q.T, np.arange(count), plan.poses, seed, allowed
        survivors(*given, tracks=tracks)
        return cls(plan.joints, plan.times, tracks)

    def content(self) -> bytes:
        """Return an NPZ file with the three arrays."""
        file = io.BytesIO()
        np.savez_compressed(
            file,
            joints=np.array(self.joints),
            times=self.times,
            configurations=self.configurations,
        )
        return file.getvalue()
