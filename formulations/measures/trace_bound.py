"""The bound on the worst case from ‖J‖_F² alone (eq. 6), and how far a value is from one."""

import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray, as_floats, whole_number
from nlp.errors import InputError


def sigma_bound(task_dimension: int, joints: int, trace: float, locked: int = 1) -> float:
    """Upper bound on the worst case after any `locked` joints lock (eq. 6, for every J).

    For one joint it is √(T(n − m)/(mn)), T = ‖J‖_F²; with T = mσ² this is σ√((n − m)/n). It
    is the root of `eigenvalue_bound`.
    """
    return float(np.sqrt(eigenvalue_bound(task_dimension, joints, trace, locked)))


def eigenvalue_bound(task_dimension: int, joints: int, trace: float, locked: int = 1) -> float:
    """Upper bound on t, the least eigenvalue of J_F̄J_F̄ᵀ over all sets F of `locked` joints.

    For one joint t ≤ T(n − m)/(mn), the square of eq. (6). It needs no isotropy: summing the
    rank-one downdate condition j_fᵀ(JJᵀ − tI)⁻¹j_f ≤ 1 over f gives
    tr((JJᵀ − tI)⁻¹) ≤ (n − m)/t, and convexity the rest. For k joints t ≤ (T/m)y with y the
    least entry of `averaged_spectrum` of the identity, derived in
    docs/several_failures.md; zero where fewer than m joints are left.

    Parameters
    ----------
    task_dimension, joints
        m and n, n > m.
    trace
        T = ‖J‖_F², in the squared units of J.
    locked
        How many joints lock at once, k.

    Raises
    ------
    InputError
        If a number is out of range.
    """
    m = whole_number("task dimension", task_dimension, 1)
    n = whole_number("joints", joints, m + 1)
    k = whole_number("locked joints", locked, 1)
    if not (np.isfinite(trace) and trace >= 0):
        raise InputError("trace", trace, "a finite number of at least 0")
    if k > n - m:
        return 0.0
    if k == 1:
        return trace * (n - m) / (m * n)
    return float(trace / m * averaged_spectrum(np.ones(m), n, k)[0])


def averaged_spectrum(eigenvalues: npt.ArrayLike, joints: int, locked: int = 1) -> FloatArray:
    """Roots of the mean of det(xI − J_F̄J_F̄ᵀ) over all sets F of `locked` joints, ascending.

    They depend on the eigenvalues λ of JJᵀ alone. Averaged over one of n columns the
    characteristic polynomial is that of Λ − rrᵀ/n, r_i = √λ_i; further columns likewise.

    Parameters
    ----------
    eigenvalues
        Those of JJᵀ, shape (m,), at least 0.
    joints
        Number n of columns, above m.
    locked
        How many joints lock at once, at most n − m.
    """
    values = as_floats("eigenvalues", eigenvalues)
    n = whole_number("joints", joints, values.size + 1)
    if whole_number("locked joints", locked, 1) > n - values.size:
        raise InputError("locked joints", locked, f"at most {n - values.size}")
    for removed in range(locked):
        roots = np.sqrt(np.maximum(values, 0.0))
        rest = np.diag(values) - np.outer(roots, roots) / (n - removed)
        values = np.asarray(np.linalg.eigvalsh(rest), dtype=np.float64)
    return np.maximum(values, 0.0)


def gap_percent(found: float, bound: float) -> float:
    """100·|bound − found|/bound: how far a value is from its bound, in percent of the bound.

    NaN where the bound is 0 and the value is not, as a percentage says nothing there.
    """
    if bound == 0:
        return 0.0 if found == 0 else float("nan")
    return 100.0 * abs(bound - found) / abs(bound)
