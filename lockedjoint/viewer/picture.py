"""What is drawn of a robot: from an arm, its configuration and the joints that have locked.

The picture is plain arrays; `scene` draws it. Letters: n joints, k motions (joints, and those
that mimic them), m task directions; J is the Jacobian in units of the characteristic length ℓ,
shape (m, n); σ is a least singular value of J or of what failures leave of it; (v; ω) is a
velocity of the tip, linear and rotational.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import measures
from lockedjoint.formulations.io.escaping import markdown
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.errors import InputError

# Length of the linear or rotational part of the worst direction, a unit vector, up to which it
# is not drawn: rounding.
NO_ARROW = 1e-9


@dataclass(frozen=True, eq=False)
class RobotPicture:
    """What is drawn of an arm, in metres and along the axes of its base.

    Attributes
    ----------
    origins, axes
        Where each joint is, and its unit axis, shape (k, 3), from base to tip.
    tip
        Position of the tip's point, shape (3,).
    before, after
        Semi-axes of the ellipsoid of the tip's velocities at joint rates of norm 1, as columns,
        longest first, shape (3, 3), in units of ℓ, with all joints and without those in
        `failed`. Velocities are linear, or rotational if the task has no linear direction.
    locked, failed
        Names of the locked joints; and the same names, or if none is locked, that of the joint
        whose failure would be the worst.
    direction
        The tip's velocity (v; ω) that suffers most after that, a unit vector in units of ℓ,
        shape (6,).
    length
        Characteristic length ℓ in metres.
    sigma, sigma_left
        Smallest singular value with all joints, and without the locked ones.
    worst_case, worst_joint
        Smallest singular value after one more failure, and which; 0 and None if there are
        not more joints left than the task has directions.
    """

    origins: FloatArray
    axes: FloatArray
    tip: FloatArray
    before: FloatArray
    after: FloatArray
    locked: tuple[str, ...]
    failed: tuple[str, ...]
    direction: FloatArray
    length: float
    sigma: float
    sigma_left: float
    worst_case: float
    worst_joint: str | None


def picture(
    arm: RobotArm, configuration: npt.ArrayLike, locked: Collection[str] = ()
) -> RobotPicture:
    """Return what is drawn of an arm.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    configuration
        Positions of the free joints, radians or metres, shape (n,).
    locked
        Names of joints that have locked, where they are.

    Raises
    ------
    InputError
        If a joint is unknown, or the configuration is not one number for each.
    """
    names = arm.chain.names
    for name in locked:
        if name not in names:
            raise InputError("locked joint", name, "one of " + ", ".join(names))
    point = finite_vector("configuration", configuration, arm.size)
    matrix = arm.jacobian(point)
    indices = [k for k, name in enumerate(names) if name in locked]
    remaining = np.delete(matrix, indices, axis=1)
    worst_case, worst_joint = 0.0, None
    if remaining.shape[1] > len(matrix):
        worst = measures.worst_case(remaining)
        worst_case = worst.sigma
        worst_joint = [name for name in names if name not in locked][worst.joints[0]]
    failed = indices or ([names.index(worst_joint)] if worst_joint else [])
    after = np.delete(matrix, failed, axis=1)
    axes, origins, tip, orientation = arm.chain.frames(point[:, None])
    rotated = orientation[..., 0] if arm.task.frame == "tip" else np.eye(3)
    rows = slice(0, 3) if arm.task.linear else slice(3, 6)
    direction = _along_base(arm, measures.weakest_direction(after)[:, None], rotated)[:, 0]
    return RobotPicture(
        origins=origins[..., 0],
        axes=axes[..., 0],
        tip=tip[:, 0],
        before=_semi_axes(_along_base(arm, matrix, rotated)[rows]),
        after=_semi_axes(_along_base(arm, after, rotated)[rows]),
        locked=tuple(names[k] for k in indices),
        failed=tuple(names[k] for k in failed),
        direction=direction,
        length=arm.length_at(point),
        sigma=_smallest(matrix),
        sigma_left=_smallest(remaining),
        worst_case=worst_case,
        worst_joint=worst_joint,
    )


def _semi_axes(matrix: FloatArray) -> FloatArray:
    """Return the semi-axes of {A·x : |x| ≤ 1} as columns, longest first; A has shape (3, k)."""
    left, values, _ = np.linalg.svd(matrix)
    lengths = np.zeros(3)
    lengths[: len(values)] = values
    return np.asarray(left * lengths)


def _smallest(matrix: FloatArray) -> float:
    """Return the least singular value of a matrix, (m, k); 0 if k < m."""
    m, n = matrix.shape
    return float(np.linalg.svd(matrix, compute_uv=False)[-1]) if n >= m else 0.0


def _along_base(arm: RobotArm, matrix: FloatArray, rotated: FloatArray) -> FloatArray:
    """Return all six rows (v; ω) along the base's axes, (6, k), 0 where the task has none.

    `matrix` has the task's rows, shape (m, k), and `rotated` turns their frame to the base's.
    """
    full = np.zeros((6, matrix.shape[1]))
    full[arm.task.rows] = matrix
    return np.vstack([rotated @ full[:3], rotated @ full[3:]])


def numbers(shown: RobotPicture, arm: RobotArm) -> str:
    """Return the numbers of a picture as Markdown, in which joints' names are no syntax."""
    largest = [f"{np.linalg.norm(axes[:, 0]):.4f}" for axes in (shown.before, shown.after)]
    names = ("vx", "vy", "vz", "wx", "wy", "wz")
    direction = "  ".join(
        f"{name} {value:+.2f}"
        for name, value in zip(names, shown.direction, strict=True)
        if arm.task.mixed or abs(value) > NO_ARROW
    )
    return "\n".join(
        [
            "| | |",
            "|:--|:--|",
            f"| sigma, all joints | {shown.sigma:.4f} |",
            f"| sigma, locked joints out | {shown.sigma_left:.4f} |",
            f"| worst case of one more | **{shown.worst_case:.4f}** |",
            f"| worst joint | {markdown(shown.worst_joint or 'no joint to spare')} |",
            f"| locked | {', '.join(map(markdown, shown.locked)) or 'none'} |",
            f"| largest velocity | {' → '.join(largest)} |",
            f"| worst direction | {direction} |",
            f"| length | {shown.length:.4f} m |",
        ]
    )
