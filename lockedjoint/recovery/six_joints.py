"""All configurations of six revolute joints at a pose, by eigenvalues.

The line of the last axis, a point p and a direction l, does not move with its joint. Of a line
the numbers p, l, p·p, p·l, p×l, (p·p)l − 2(p·l)p and 1 are mapped by a motion linearly, by a
matrix D, which for a rotation is linear in its cosine and sine. A loop R₁T₁…R₆T₆ = 1 says

    D(T₂)D(R₃)D(T₃)D(R₄)D(T₄)D(R₅)D(T₅) f = D(R₂)⁻¹D(T₁)⁻¹D(R₁)⁻¹D(T₆)⁻¹ f:

14 equations, from which the eight products of angles 1 and 2 are eliminated. In tangents of
half the angles the six that are left, and the same times that of angle 4, have the quadratic
eigenvalue problem of 12×12 matrices whose eigenvalues are those of angle 3 (Raghavan and Roth
1990; Manocha and Canny 1994): at most 16 of the arm.

It fails for some geometries, each a different one for each joint that the loop begins with.
So it is first tried at configurations that are known, of the very arm.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import eig
from scipy.spatial.transform import Rotation

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.link_chain import homogeneous, rotation
from lockedjoint.kinematics.pose import Pose
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.recovery.goal import GoalResidual, ToolGoal

# Configurations at which the method is tried, and how near to them it has to come.
_TRIED, _NEAR = 8, 1e-2
# Imaginary parts, as shares, of eigenvalues that may be real; Newton's method says which are.
_REAL = 1e-2
# Cosine, sine and 1 of an angle times 1 + x², by 1, x and x², with x the tangent of its half.
_HALF = np.array([[1.0, 0.0, -1.0], [0.0, 2.0, 0.0], [1.0, 0.0, 1.0]])
_P, _L, _PP, _PL, _PXL, _M, _ONE = slice(3), slice(3, 6), 6, 7, slice(8, 11), slice(11, 14), 14


def all_at_pose(chain: Chain, goal: ToolGoal, rng: np.random.Generator) -> FloatArray | None:
    """Return all configurations (K, 6) at a pose, limits not regarded.

    None if the chain is not of six revolute joints, the goal not one pose, or the method misses
    one of some random configurations of the chain.
    """
    simple = [(m.variable, m.prismatic, m.multiplier) for m in chain.motions]
    exact = len(goal.rows) == 6 and goal.pose.tolerance == goal.pose.angle == 0
    if not exact or simple != [(k, False, 1.0) for k in range(6)]:
        return None
    known = rng.uniform(*chain.ranges, (6, _TRIED))
    position, turned = chain.tip_at(known)
    beginnings = list(range(6))
    for k in range(_TRIED):
        quaternion = Rotation.from_matrix(turned[:, :, k]).as_quat()
        pose = ToolGoal(Pose(tuple(position[:, k].tolist()), tuple(quaternion.tolist())))
        beginnings = [b for b in beginnings if _finds(chain, pose, b, known[:, k], rng)]
    if not beginnings:
        return None
    found = np.concatenate([_from(chain, goal, begin, rng) for begin in beginnings])
    everywhere = np.full((6, 1), np.inf)
    q, reached = GoalResidual(goal, chain).solved(found.T, -everywhere, everywhere)
    return np.asarray(q[:, reached].T)


def _finds(
    chain: Chain, goal: ToolGoal, begin: int, known: FloatArray, rng: np.random.Generator
) -> bool:
    off = _from(chain, goal, begin, rng) - known
    off -= 2 * np.pi * np.round(off / (2 * np.pi))
    return bool(np.any(np.max(np.abs(off), axis=1) < _NEAR))


def _from(chain: Chain, goal: ToolGoal, begin: int, rng: np.random.Generator) -> FloatArray:
    """Return configurations (K, 6) near those at a pose, by a loop that begins at a joint."""
    target = homogeneous(goal.pose.rotation, goal.position)
    first, *links = (np.array(motion.placement) for motion in chain.motions)
    links.append(np.array(chain.end) @ np.linalg.inv(target) @ first)
    unit = sum(np.linalg.norm(link[:3, 3]) for link in links) or 1.0
    for link in links:
        link[:3, 3] *= 6 / unit
    order = np.roll(np.arange(6), -begin)
    axes = np.array([motion.axis for motion in chain.motions])
    angles = _loop(axes[order], [links[k] for k in order], rng.uniform(-np.pi, np.pi, 6))
    return angles[:, np.argsort(order)] - [motion.offset for motion in chain.motions]


def _loop(axes: FloatArray, links: Sequence[FloatArray], shift: FloatArray) -> FloatArray:
    """Return angles (K, 6) near solutions of a loop, shifted to be off half a turn."""
    turns = rotation(axes, shift)
    links = [homogeneous(turn) @ link for turn, link in zip(turns, links, strict=True)]
    line = np.zeros(15)
    line[_L], line[_ONE] = axes[5], 1.0
    parts = [_rotation_parts(axis) for axis in axes]
    back = [part * np.array([1.0, -1.0, 1.0])[:, None, None] for part in parts]
    inverse = [_line_map(np.asarray(np.linalg.inv(link))) for link in links]
    maps = [_line_map(link) for link in links]
    inner = np.einsum("jcd,dk->jck", parts[3], maps[3] @ (parts[4] @ (maps[4] @ line)).T)
    middle = np.einsum("ac,icd,jdk->aijk", maps[1][:14], parts[2], maps[2] @ inner)
    last = inverse[0] @ (back[0] @ (inverse[5] @ line)).T
    ends = np.einsum("iab,bj->aij", back[1][:, :14], last)
    middle[:, 2, 2, 2] -= ends[:, 2, 2]
    left, right = middle.reshape(14, 27), ends.reshape(14, 9)[:, :8]
    without = np.linalg.svd(right)[0][:, 8:].T @ left
    powers = np.einsum("nijk,ia,jb,kc->anbc", without.reshape(6, 3, 3, 3), *[_HALF] * 3)
    square = np.zeros((3, 12, 4, 3))
    square[:, :6, :3] = square[:, 6:, 1:] = powers
    constant, linear, quadratic = square.reshape(3, 12, 12)
    none, one = np.zeros((12, 12)), np.eye(12)
    companion = np.block([[none, one], [-constant, -linear]])
    values, vectors = eig(companion, np.block([[one, none], [none, quadratic]]))
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if not np.isfinite(value) or abs(value.imag) > _REAL * (1 + abs(value)):
            continue
        # Powers 0 to 3 of the tangent of angle 4, and 0 to 2 of that of angle 5.
        table = (vector[:12] if abs(value) < 1 else vector[12:]).reshape(4, 3)
        ratios = [
            np.vdot(low, high) / np.vdot(low, low)
            for low, high in ((table[:-1], table[1:]), (table[:, :-1], table[:, 1:]))
        ]
        angles = 2 * np.arctan([value.real, *(ratio.real for ratio in ratios)])
        known = [np.array([np.cos(angle), np.sin(angle), 1.0]) for angle in angles]
        products = left @ np.einsum("i,j,k->ijk", *known).ravel()
        others = np.append(np.linalg.lstsq(right, products, rcond=1e-9)[0], 1.0).reshape(3, 3)
        first = np.arctan2(others[2, 1], others[2, 0])
        five = [first, np.arctan2(others[1, 2], others[0, 2]), *angles]
        pose = np.eye(4)
        for turn, link in zip(rotation(axes[:5], np.array(five)), links, strict=False):
            pose = pose @ homogeneous(turn) @ link
        last = Rotation.from_matrix((np.linalg.inv(pose) @ np.linalg.inv(links[5]))[:3, :3])
        sixth = 2 * np.arctan2(last.as_quat()[:3] @ axes[5], last.as_quat()[3])
        found.append([*five, sixth] + shift)
    return np.array(found).reshape(-1, 6)


def _line_map(pose: FloatArray) -> FloatArray:
    """Return D of a motion, 15×15."""
    turn, shift = pose[:3, :3], pose[:3, 3]
    cross = np.cross(np.eye(3), shift)
    made = np.zeros((15, 15))
    for rows in (_P, _L, _PXL, _M):
        made[rows, rows] = turn
    made[_PP, _PP] = made[_PL, _PL] = made[_ONE, _ONE] = 1.0
    made[_P, _ONE] = shift
    made[_PP, _P], made[_PP, _ONE] = 2 * shift @ turn, shift @ shift
    made[_PL, _L] = shift @ turn
    made[_PXL, _L] = cross @ turn
    made[_M, _PXL], made[_M, _PL] = -2 * cross @ turn, -2 * shift
    made[_M, _L] = (shift @ shift) * turn - 2 * np.outer(shift, shift @ turn)
    return made


def _rotation_parts(axis: FloatArray) -> FloatArray:
    """Return what cosine, sine and 1 are multiplied by in D of a rotation, (3, 15, 15)."""
    along = np.outer(axis, axis)
    cross = np.cross(np.eye(3), axis)
    made = np.zeros((3, 15, 15))
    for rows in (_P, _L, _PXL, _M):
        made[:, rows, rows] = np.eye(3) - along, cross, along
    for number in (_PP, _PL, _ONE):
        made[2, number, number] = 1.0
    return made
