"""Failures that no posture tolerates, or hardly any: structural and near-structural ones.

Let σ_f(q) be the least singular value that is left of J(q) once joint f locks, and σ(q) that of
the whole J(q). Over random postures within the limits ::

    ratio_f = max σ_f / max σ

A failure is *structural* if the ratio is 0, up to rounding in the robot's file: σ_f is 0 at
every posture. The samples prove that with probability 1, because the determinant of what is
left of JJᵀ is an analytic function of q, which is zero everywhere or on a set of no volume. A
failure is *near-structural* if the ratio is small: the joints are placed as in a structural
arm, but for small offsets.

In six dimensions there is mostly a geometric reason: the axes of all other joints meet one
line, whatever the posture. A force along that line does no work on any of them, so that no
joint moves the tool against it. Two runs of axes that each meet in a point, or are parallel,
have such a line, through both points; so do one such run and any two axes. In an arm with a
spherical shoulder and a spherical wrist, for example, a locked elbow fixes the distance
between them.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import DIRECTIONS
from lockedjoint.nlp.arrays import FloatArray

# So many random postures are tried.
_RANDOM_POSTURES = 200
# The geometry of the axes is looked at in so many of these postures.
_GEOMETRY_POSTURES = 8
# Ratios up to this are 0: an angle of 90° is written 1.5708 in many files.
_ROUNDING_RATIO = 1e-5
# Ratios up to this are small. Those of arms that exist are 0.001 to 0.026, or 0.14 and more.
_SMALL_RATIO = 0.05
# The reason is given where the axes miss a common line by at most this share of their distances
# from the tool.
_NEARLY_SHARE = 0.1
# Axes are parallel, and turns without pitch, up to this: a sine, or metres per radian.
_PARALLEL_SINE = 1e-5


@dataclass(frozen=True)
class StructuralFailure:
    """A joint whose failure is fatal, or nearly so, at every posture."""

    joint: str
    kind: Literal["structural", "near-structural"]
    #: The ratio is the largest σ left after the failure, at any posture tried, to that before.
    ratio: float
    #: The axes of the other joints miss a line that would make the failure structural: by at
    #: most so many metres at any posture. None if that is not the reason, or the task has fewer
    #: than six directions.
    miss: float | None

    @property
    def sentence(self) -> str:
        """What that means, for a reader."""
        exact = self.kind == "structural"
        effect = (
            "no posture keeps full rank once it locks"
            if exact
            else f"once it locks, none of {_RANDOM_POSTURES} random postures keeps more than "
            f"{100 * self.ratio:.2g} % of the best sigma before it"
        )
        if self.miss is None:
            return f"{self.joint}: {effect}"
        but = "" if exact else f", but for {1000 * self.miss:.2g} mm"
        reason = f"the axes of the other joints meet one line{but}"
        return f"{self.joint}: {effect}, because {reason}; try --task position"


@lru_cache(maxsize=64)
def structural_failures(arm: RobotArm) -> tuple[StructuralFailure, ...]:
    """Return the joints whose single failure is fatal at every posture, or nearly so.

    In their order; all of them, if the arm cannot do the task even before a failure. InputError
    if the length is not given, and the axes of all revolute joints meet at the tip.
    """
    postures = arm.samples(np.random.default_rng(1995), _RANDOM_POSTURES)
    matrices = np.array([measures.as_jacobian(arm.jacobian(posture)) for posture in postures])
    left = [np.delete(matrices, f, axis=2) for f in range(arm.size)]
    after = np.array([np.max(_least(some)) for some in left])
    before, size = np.max(_least(matrices)), np.max(np.abs(matrices))
    able = before > _ROUNDING_RATIO * 1e-3 * size
    ratios = after / before if able else np.zeros(len(after))
    drawn = [arm.metric_jacobian(posture) for posture in postures[:_GEOMETRY_POSTURES]]
    whole = arm.task.directions == DIRECTIONS and able
    failures = []
    for f in np.flatnonzero(ratios <= _SMALL_RATIO):
        miss = _miss([np.delete(columns, f, axis=1) for columns in drawn]) if whole else None
        kind: Literal["structural", "near-structural"] = (
            "structural" if ratios[f] <= _ROUNDING_RATIO else "near-structural"
        )
        failures.append(StructuralFailure(arm.chain.names[f], kind, float(ratios[f]), miss))
    return tuple(failures)


def _least(matrices: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.svd(matrices, compute_uv=False)[:, -1])


def _miss(drawn: list[FloatArray]) -> float | None:
    """By how much the axes, columns (v; ω) at several postures, miss a line; None if by far."""
    splits = range(drawn[0].shape[1] + 1)
    misses = [max(_apart(columns, k) for columns in drawn) for k in splits]
    least = min(misses)
    far = max(float(np.linalg.norm(columns[:3], axis=0).max()) for columns in drawn)
    return least if least <= _NEARLY_SHARE * far else None


def _apart(columns: FloatArray, split: int) -> float:
    """The larger of the distances at which the axes on either side of a split miss a point."""
    sides = columns[:, :split], columns[:, split:]
    if min(side.shape[1] for side in sides) <= 2:  # a line through a point meets any two lines
        sides = (max(sides, key=lambda side: side.shape[1]),) * 2
    return max(_spread(side) for side in sides)


def _spread(columns: FloatArray) -> float:
    """How far from a common point some lines are; 0 if they are parallel.

    A column (v; ω) is a turn about the line along ω through ω × v/|ω|², relative to the tip,
    if v ⟂ ω.
    """
    speeds, turns = columns[:3].T, columns[3:].T
    rates = np.linalg.norm(turns, axis=1, keepdims=True)
    if np.min(rates) == 0:  # a joint that slides, and has no axis
        return float("inf")
    along, points = turns / rates, np.cross(turns, speeds) / rates**2
    if np.max(np.abs(np.sum(along * speeds, axis=1)) / rates[:, 0]) > _PARALLEL_SINE:
        return float("inf")
    if np.max(np.linalg.norm(np.cross(along, along[0]), axis=1)) < _PARALLEL_SINE:
        return 0.0
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    centre = np.linalg.lstsq(np.sum(across, axis=0), np.sum(points, axis=0), rcond=None)[0]
    return float(np.max(np.linalg.norm(across @ centre - points, axis=1)))
