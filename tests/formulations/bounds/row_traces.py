"""Oracles of the relaxation: closed forms where traces of blocks of rows say all."""

from fractions import Fraction

from lockedjoint.formulations.joints.kinds import Prismatic, UnitRevolute

FIXED = (UnitRevolute, Prismatic)


def block_trace_bound(joints, sizes, traces):
    """The largest t where blocks of JJᵀ of these sizes have at most these traces.

    It is the root of Σ_B m_B/(T_B/m_B − t) = (n − m)/t below every T_B/m_B, by bisection.
    """
    means = [trace / size for size, trace in zip(sizes, traces, strict=True)]
    low, high = 0.0, min(means)
    while low < (t := 0.5 * (low + high)) < high:
        spent = t * sum(size / (mean - t) for size, mean in zip(sizes, means, strict=True))
        low, high = (t, high) if spent < joints - sum(sizes) else (low, t)
    return high


def spatial_bound(arm):
    """The same of revolute and prismatic joints: by both blocks, and by each alone."""
    n, r = len(arm.joints), sum(not isinstance(one, Prismatic) for one in arm.joints)
    linear = arm.largest_trace - r
    both = block_trace_bound(n, (3, 3), (linear, float(r)))
    return min(both, linear * (n - 3) / (3 * n), (r - 3) / 3)


def isotropic_bound(arm):
    """t = T/m − max ‖j‖² of isotropic arms; unit and prismatic columns have fixed norms."""
    r = sum(not isinstance(one, Prismatic) for one in arm.joints)
    fixed = [Fraction(one.largest_norm_squared) for one in arm.joints if isinstance(one, FIXED)]
    rest = 2 * r - sum(fixed)
    largest = max([*fixed, rest / max(len(arm.joints) - len(fixed), 1)])
    return max(float(Fraction(2 * r, 6) - largest), 0.0)
