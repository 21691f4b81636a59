"""Failures that no posture tolerates, or hardly any: structural and near-structural ones.

Let σ_f(q) be the least singular value that is left of J(q) once joint f locks, and σ(q) that of
the whole J(q). Over random postures q within the limits ::

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
between them. `StructuralFailure.miss` is by how many metres the axes miss such a line.

Geometry is computed from columns (v; ω) in metres and radians, relative to the tip: ω is the
direction of a joint's axis, and v the velocity of the tip when the joint turns by 1 rad/s.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import DIRECTIONS
from lockedjoint.nlp.arrays import FloatArray

# Number of random postures: with more, the largest ratio is known better, and costs more.
_RANDOM_POSTURES = 200
# Number of these postures at which the geometry of the axes is looked at.
_GEOMETRY_POSTURES = 8
# Seed of the random postures: any number; a fixed one gives the same answer every time.
_SEED = 1995
# Ratio up to which it counts as 0: an angle of 90° is written 1.5708 in many files.
_ROUNDING_RATIO = 1e-5
# Ratio up to which it is small. Those of arms that exist are 0.001 to 0.026, or 0.14 and more.
_SMALL_RATIO = 0.05
# Largest σ over the largest entry of J, over all postures, up to which an arm cannot do its
# task even before a failure.
_UNABLE_SHARE = 1e-8
# Largest miss for which the geometric reason is given, as a share of the largest |v|: the
# largest distance of an axis from the tool.
_NEARLY_SHARE = 0.1
# Largest sine of an angle between axes that count as parallel.
_PARALLEL_SINE = 1e-5
# Largest pitch of a column that counts as a turn, metres per radian: along its axis a turn does
# not move.
_NO_PITCH_M_PER_RAD = 1e-5


@dataclass(frozen=True)
class StructuralFailure:
    """A joint whose failure is fatal, or nearly so, at every posture."""

    joint: str  #: Its name.
    kind: Literal["structural", "near-structural"]
    #: The ratio is the largest σ left after the failure, at any posture tried, to that before.
    ratio: float
    #: The axes of the other joints miss a line that would make the failure structural by at
    #: most this, in metres, at any posture looked at. None if that is not the reason, or the
    #: task has fewer than six directions.
    miss: float | None

    @property
    def sentence(self) -> str:
        """Say for a reader what that means, and why it is so."""
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
    postures = arm.samples(np.random.default_rng(_SEED), _RANDOM_POSTURES)
    matrices = np.array([measures.as_jacobian(arm.jacobian(posture)) for posture in postures])
    left = [np.delete(matrices, f, axis=2) for f in range(arm.size)]
    after = np.array([np.max(_least(some)) for some in left])
    before, size = np.max(_least(matrices)), np.max(np.abs(matrices))
    able = before > _UNABLE_SHARE * size
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
    """Return the least singular values of matrices, shape (N, m, k) → (N,)."""
    return np.asarray(np.linalg.svd(matrices, compute_uv=False)[:, -1])


def _miss(drawn: list[FloatArray]) -> float | None:
    """Return by how many metres axes miss a common line; None if by far.

    `drawn` has the columns (v; ω), shape (6, axes), of the same axes at several postures. The
    axes are tried as two runs, split at every place: the same split has to do at all postures.
    """
    splits = range(drawn[0].shape[1] + 1)
    misses = [max(_apart(columns, k) for columns in drawn) for k in splits]
    least = min(misses)
    far = max(float(np.linalg.norm(columns[:3], axis=0).max()) for columns in drawn)
    return least if least <= _NEARLY_SHARE * far else None


def _apart(columns: FloatArray, split: int) -> float:
    """Return by how many metres the axes before and after a split miss a point each.

    Columns (v; ω) have shape (6, axes); the larger of both distances is returned.
    """
    sides = columns[:, :split], columns[:, split:]
    if min(side.shape[1] for side in sides) <= 2:  # a line through a point meets any two lines
        sides = (max(sides, key=lambda side: side.shape[1]),) * 2
    return max(_spread(side) for side in sides)


def _spread(columns: FloatArray) -> float:
    """Return the largest distance of axes from the point nearest to all; 0 if parallel.

    A column (v; ω) of shape (6, axes) is a turn about the line along ω through ω × v/|ω|²,
    relative to the tip, if v ⟂ ω. A joint that slides, or a screw, has no such line: infinity.
    With a a line's direction, b its point and A = I − aaᵀ, the point c nearest to all lines in
    least squares solves Σ A c = Σ b, and ‖A c − b‖ is its distance from one.
    """
    speeds, turns = columns[:3].T, columns[3:].T
    rates = np.linalg.norm(turns, axis=1, keepdims=True)
    if np.min(rates) == 0:
        return float("inf")
    along, points = turns / rates, np.cross(turns, speeds) / rates**2
    if np.max(np.abs(np.sum(along * speeds, axis=1)) / rates[:, 0]) > _NO_PITCH_M_PER_RAD:
        return float("inf")
    if np.max(np.linalg.norm(np.cross(along, along[0]), axis=1)) < _PARALLEL_SINE:
        return 0.0
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    centre = np.linalg.lstsq(np.sum(across, axis=0), np.sum(points, axis=0), rcond=None)[0]
    return float(np.max(np.linalg.norm(across @ centre - points, axis=1)))
