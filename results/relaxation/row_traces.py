"""Closed forms where traces of blocks of rows say all that the relaxation knows of an arm.

What comes in: an arm of n joints, whose Jacobian J has m rows, in blocks B of m_B rows. What is
known of J is that the block of JJᵀ has at most the trace T_B. What goes out: t, the square of
an upper bound of the worst case after one joint locks. In space there are two blocks of three
rows, velocities and rotations; a revolute joint has a rotation of length 1, so the trace of the
second block is r, the number of revolute joints.
"""

from collections.abc import Sequence
from fractions import Fraction

from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute

# Kinds of joints whose columns have a fixed length.
_FIXED = (UnitRevolute, Prismatic)
# Kinds of joints of which nothing else is known than the traces.
_SPATIAL = (*_FIXED, LeverRevolute)


def block_trace_bound(joints: int, sizes: Sequence[int], traces: Sequence[float]) -> float:
    """Return the largest t where blocks of JJᵀ of these sizes have at most these traces.

    `joints` is n; `sizes` and `traces` are the m_B and T_B, one for each block.

    It is the root of Σ_B m_B/(T_B/m_B − t) = (n − m)/t below every T_B/m_B, by bisection.
    """
    means = [trace / size for size, trace in zip(sizes, traces, strict=True)]
    low, high = 0.0, min(means)
    while low < (t := 0.5 * (low + high)) < high:
        spent = t * sum(size / (mean - t) for size, mean in zip(sizes, means, strict=True))
        low, high = (t, high) if spent < joints - sum(sizes) else (low, t)
    return high


def spatial_bound(arm: Arm) -> float | None:
    """Return t of revolute and prismatic joints, by both blocks and by each alone.

    None where an arm has other joints, or screws, of which v·ω is known too.
    """
    joints = arm.joints
    if not all(isinstance(one, _SPATIAL) and not getattr(one, "pitch", 0) for one in joints):
        return None
    n, r = len(joints), sum(not isinstance(one, Prismatic) for one in joints)
    linear = arm.largest_trace - r
    both = block_trace_bound(n, (3, 3), (linear, float(r)))
    return min(both, linear * (n - 3) / (3 * n), (r - 3) / 3)


def isotropic_bound(arm: Arm) -> float:
    """Return t = T/m − max ‖j‖² of isotropic arms; unit and prismatic columns are fixed."""
    r = sum(not isinstance(one, Prismatic) for one in arm.joints)
    fixed = [
        Fraction(one.largest_norm_squared) for one in arm.joints if isinstance(one, _FIXED)
    ]
    rest = 2 * r - sum(fixed)
    largest = max([*fixed, rest / max(len(arm.joints) - len(fixed), 1)])
    return max(float(Fraction(2 * r, 6) - largest), 0.0)
