"""A Jacobian before and after failures: singular values, shares, isotropy (eqs. 3–6, 9–11).

J is a matrix of shape (m, n) with n > m: m task dimensions, one column for each of n joints,
counted from 0. F is a set of k joints that lock; J_F has their columns, J_F̄ all others.
T = tr JJᵀ = ‖J‖_F². Singular values σ₁ ≥ … ≥ σ_m have the units of J. Functions take anything
that NumPy makes an array of, check it (`as_jacobian`), and return new arrays of doubles.
"""

from collections.abc import Collection
from itertools import combinations
from math import comb

import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import (
    LARGEST_ENTRY,
    FloatArray,
    as_floats,
    finite_vector,
    real_number,
    whole_number,
)
from lockedjoint.nlp.errors import InputError, entries_of

# Magnitude of the largest entry of a Jacobian below which it is refused.
_SMALLEST = 1 / LARGEST_ENTRY
#: Largest number of sets of locked joints that a measure takes: each needs a singular value
#: decomposition.
MOST_SETS = 100_000
# Largest number of sets that a nonlinear program takes. Each is an inequality: 1000 take 10 s
# to state.
_MOST_STATED = 1000
# Largest number of entries of J, counted once for each set of locked joints, that a measure
# takes. So many take seconds.
_MOST_ENTRIES = 100_000_000
# Number of entries that are decomposed at once. More need more memory: eight bytes each.
_CHUNK = 1_000_000
# A number of sets that is larger than this is not written out in a message.
_MOST_SHOWN = 10**15


def as_jacobian(jacobian: npt.ArrayLike, name: str = "jacobian") -> FloatArray:
    """Return the array as a Jacobian of floats.

    Raises
    ------
    InputError
        If it is not two-dimensional, has NaN, infinity or masked entries, its largest entry is
        not 0 and not between 1e-70 and 1e70, or it has no more columns than rows.
    """
    matrix = as_floats(name, jacobian)
    if matrix.ndim != 2 or 0 in matrix.shape:
        raise InputError(name, f"of shape {matrix.shape}", "a matrix, one column per joint")
    if not np.all(np.isfinite(matrix)):
        raise InputError(name, "a matrix with NaN or infinity", "finite numbers only")
    largest = float(np.max(np.abs(matrix)))
    if largest and not _SMALLEST <= largest <= LARGEST_ENTRY:
        allowed = f"one from {_SMALLEST:g} to {LARGEST_ENTRY:g} in magnitude"
        raise InputError(name, f"a matrix whose largest entry is {largest:g}", allowed)
    m, n = matrix.shape
    if n <= m:
        allowed = "more columns (joints) than rows (task dimensions)"
        raise InputError(name, f"of shape {m}×{n}", allowed)
    return matrix


def trace(jacobian: npt.ArrayLike) -> float:
    """Return T = ‖J‖_F² = tr JJᵀ."""
    return float(np.sum(as_jacobian(jacobian) ** 2))


def singular_values(jacobian: npt.ArrayLike) -> FloatArray:
    """Return the singular values in descending order, shape (m,) (eqs. 3–4)."""
    return np.asarray(np.linalg.svd(as_jacobian(jacobian), compute_uv=False))


def condition_number(jacobian: npt.ArrayLike) -> float:
    """Return σ₁/σ_m; infinity for a Jacobian that is singular up to rounding."""
    matrix = as_jacobian(jacobian)
    values = singular_values(matrix)
    regular = _numerical_rank(values, matrix) == len(values)
    return float(values[0] / values[-1]) if regular else float("inf")


def manipulability(jacobian: npt.ArrayLike) -> float:
    """Return √det(JJᵀ), the product of the singular values (Yoshikawa, 1985).

    It is 0 only if one of them is 0: a product that underflows is the least positive number.
    """
    values = singular_values(jacobian)
    with np.errstate(over="ignore"):  # infinity, where many of them are large
        product = float(np.prod(values))
    return product or (float(np.nextafter(0, 1)) if values[-1] > 0 else 0.0)


def _numerical_rank(values: FloatArray, matrix: FloatArray) -> int:
    """Return the number of singular values that are more than rounding."""
    return int(np.sum(values > values[0] * max(matrix.shape) * np.finfo(float).eps))


def range_contributions(jacobian: npt.ArrayLike) -> FloatArray:
    """Return R_i, each joint's share in the range of Jᵀ, 0 to 1, shape (n,) (eq. 9).

    With J = U S Vᵀ it is the squared norm of column i of Vᵀ. The sum of all is the rank.
    """
    matrix = as_jacobian(jacobian)
    _, values, rows = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(np.sum(rows[: _numerical_rank(values, matrix)] ** 2, axis=0))


def null_space_contributions(jacobian: npt.ArrayLike) -> FloatArray:
    """Return N_i = 1 − R_i, each joint's share in the null space, shape (n,) (eqs. 10–11)."""
    return 1.0 - range_contributions(jacobian)


def isotropy_defect(jacobian: npt.ArrayLike) -> float:
    """Return ½‖JJᵀ − (T/m)I‖_F², zero exactly for isotropic J; the same in every frame."""
    return 0.5 * float(np.sum(_deviation(as_jacobian(jacobian)) ** 2))


def residual_sum_of_squares(jacobian: npt.ArrayLike) -> float:
    """Return fᵀf, f the m(m + 1)/2 distinct entries of JJᵀ − (T/m)I (eqs. 23–43).

    Each off-diagonal counts once, so the value depends on the frame; its minimum over
    frames is `isotropy_defect`.
    """
    deviation = _deviation(as_jacobian(jacobian))
    return float(np.sum(deviation[np.triu_indices(deviation.shape[0])] ** 2))


def is_optimally_failure_tolerant(jacobian: npt.ArrayLike, tolerance: float = 1e-6) -> bool:
    """Whether J is isotropic with columns of equal norm, to a relative tolerance (Section 2).

    Both JJᵀ = (T/m)I and ‖j_i‖² = T/n may be off by at most `tolerance`·T/m in any entry.
    """
    matrix = as_jacobian(jacobian)
    real_number("tolerance", tolerance, "a number of at least 0", least=0.0)
    m, n = matrix.shape
    size = trace(matrix)
    norms = np.sum(matrix**2, axis=0)
    error = max(np.max(np.abs(_deviation(matrix))), np.max(np.abs(norms - size / n)))
    return bool(size > 0 and error <= tolerance * size / m)


def _deviation(matrix: FloatArray) -> FloatArray:
    """Return JJᵀ − (T/m)I, shape (m, m)."""
    gram = matrix @ matrix.T
    return np.asarray(gram - np.trace(gram) / gram.shape[0] * np.eye(gram.shape[0]))


def locked_sets(matrix: FloatArray, failures: int) -> list[tuple[int, ...]]:
    """Return every set of `failures` joints in lexicographic order; InputError if too many."""
    matrix = as_jacobian(matrix, "matrix")
    n = matrix.shape[1]
    if whole_number("failures", failures, 1) >= n:
        raise InputError("failures", failures, f"fewer than the {n} joints")
    check_sets(n, failures)
    if comb(n, failures) * matrix.size > _MOST_ENTRIES:
        allowed = f"a shape with at most {_MOST_ENTRIES:.0e} entries over all failures"
        raise InputError("jacobian", f"of shape {matrix.shape[0]}×{n}", allowed)
    return list(combinations(range(n), failures))


def check_sets(joints: int, failures: int, most: int = MOST_SETS) -> None:
    """Raise InputError if more than `most` sets of `failures` joints can be chosen."""
    sets = comb(joints, failures)
    if sets > most:
        allowed = f"numbers with at most {most} sets of joints that lock at once"
        count = sets if sets < _MOST_SHOWN else "over 10**15"
        shown = f"{failures} of {joints} joints, which are {count} sets"
        raise InputError("failures", shown, allowed)


def check_locked(redundancy: int, fallible: int, failures: int) -> None:
    """Raise InputError if no problem states that so many of the joints that may fail lock.

    One does if that is at most the degree of redundancy and leaves at most `_MOST_STATED` sets.
    """
    if whole_number("failures", failures, 1) > redundancy:
        allowed = f"at most the degree of redundancy, {redundancy}"
        raise InputError("failures", failures, allowed)
    check_sets(fallible, failures, _MOST_STATED)


def locked_singular_values(jacobian: npt.ArrayLike, failures: int = 1) -> FloatArray:
    """Return the smallest singular value after each set of `failures` joints locks (eq. 5).

    Returns
    -------
    numpy.ndarray
        Shape (C(n, failures),), sets in lexicographic order; zero where fewer than m
        columns are left.
    """
    matrix = as_jacobian(jacobian)
    sets = locked_sets(matrix, failures)
    if matrix.shape[1] - failures < matrix.shape[0]:
        return np.zeros(len(sets))
    return _remaining(matrix, np.array(sets))[:, -1]


def remaining_singular_values(
    matrix: FloatArray, sets: Collection[tuple[int, ...]]
) -> FloatArray:
    """Return the singular values of J_F̄ for each set F, shape (sets, m), descending.

    All sets have one size, which leaves at least m columns.
    """
    matrix = as_jacobian(matrix, "matrix")
    chosen = as_floats("sets", entries_of("sets", sets, "sets of joints"))
    if chosen.ndim != 2 or not np.all(np.isin(chosen, range(matrix.shape[1]))):
        allowed = f"sets of as many joints each, from 0 to {matrix.shape[1] - 1}"
        raise InputError("sets", sets, allowed)
    return _remaining(matrix, chosen.astype(int))


def _remaining(matrix: FloatArray, sets: npt.NDArray[np.int_]) -> FloatArray:
    """Return what `remaining_singular_values` does, of sets as an array, shape (sets, k)."""
    size = max(1, _CHUNK // matrix.size)  # memory stays bounded, however many sets there are
    kept = np.ones((len(sets), matrix.shape[1]), dtype=bool)
    np.put_along_axis(kept, sets, False, axis=1)
    counts = kept.sum(axis=1)
    if np.any(counts != counts[:1]):
        raise InputError("sets", sets.tolist(), "sets of as many different joints each")
    left = np.nonzero(kept)[1].reshape(len(sets), -1)
    parts = [
        np.linalg.svd(
            matrix[:, left[k : k + size]].transpose(1, 0, 2),
            compute_uv=False,
        )
        for k in range(0, len(sets), size)
    ]
    return np.concatenate(parts)


def relative_manipulability(jacobian: npt.ArrayLike, failures: int = 1) -> FloatArray:
    """Return the manipulability after each set of joints locks, over that before.

    Shape (sets,). NaN if J had lost rank before; 0 where fewer than m joints are left.
    """
    matrix = as_jacobian(jacobian)
    sets, before = locked_sets(matrix, failures), singular_values(matrix)
    if _numerical_rank(before, matrix) < matrix.shape[0]:
        return np.full(len(sets), np.nan)
    if failures > matrix.shape[1] - matrix.shape[0]:
        return np.zeros(len(sets))
    return np.asarray(np.prod(remaining_singular_values(matrix, sets) / before, axis=1))


def reciprocal_conditions(jacobian: npt.ArrayLike, failures: int = 1) -> FloatArray:
    """Return σ_m/σ₁ after each set of joints locks, shape (sets,); 0 where rank is lost."""
    matrix = as_jacobian(jacobian)
    sets = locked_sets(matrix, failures)
    if failures > matrix.shape[1] - matrix.shape[0]:
        return np.zeros(len(sets))
    values = remaining_singular_values(matrix, sets)
    return np.asarray(values[:, -1] / np.maximum(values[:, 0], np.finfo(float).tiny))


def sigma_bound(task_dimension: int, joints: int, trace: float, failures: int = 1) -> float:
    """Return an upper bound on the worst case after k joints lock (eq. 6, for every J).

    For one joint it is √(T(n − m)/(mn)), T = ‖J‖_F²; with T = mσ² this is σ√((n − m)/n). It
    is the root of `eigenvalue_bound`.
    """
    return float(np.sqrt(eigenvalue_bound(task_dimension, joints, trace, failures)))


def eigenvalue_bound(
    task_dimension: int, joints: int, trace: float, failures: int = 1
) -> float:
    """Return an upper bound on t, the least eigenvalue of J_F̄J_F̄ᵀ over all F of k joints.

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
    failures
        How many joints lock at once, k.

    Raises
    ------
    InputError
        If a number is out of range.
    """
    m = whole_number("task dimension", task_dimension, 1)
    n = whole_number("joints", joints, m + 1)
    k = whole_number("failures", failures, 1)
    trace = real_number("trace", trace, "a finite number of at least 0", least=0.0)
    if k > n - m:
        return 0.0
    if k == 1:
        return trace * (n - m) / (m * n)
    return float(trace / m * averaged_spectrum(np.ones(m), n, k)[0])


def averaged_spectrum(eigenvalues: npt.ArrayLike, joints: int, failures: int = 1) -> FloatArray:
    """Return the roots of the mean of det(xI − J_F̄J_F̄ᵀ) over all F of k joints, ascending.

    Shape (m,). They depend on the eigenvalues λ of JJᵀ alone. Averaged over one of n columns
    the characteristic polynomial is that of Λ − rrᵀ/n, Λ = diag λ, r_i = √λ_i; further columns
    likewise.

    Parameters
    ----------
    eigenvalues
        Those of JJᵀ, shape (m,), at least 0.
    joints
        Number n of columns, above m.
    failures
        How many joints lock at once, at most n − m.
    """
    values = as_floats("eigenvalues", eigenvalues)
    values = finite_vector("eigenvalues", values, values.size)
    n = whole_number("joints", joints, values.size + 1)
    if whole_number("failures", failures, 1) > n - values.size:
        raise InputError("failures", failures, f"at most {n - values.size}")
    for removed in range(failures):
        roots = np.sqrt(np.maximum(values, 0.0))
        rest = np.diag(values) - np.outer(roots, roots) / (n - removed)
        values = np.asarray(np.linalg.eigvalsh(rest), dtype=np.float64)
    return np.maximum(values, 0.0)


def gap_percent(found: float, bound: float) -> float:
    """Return 100·|bound − found|/bound, how far a value is from its bound in percent of it.

    NaN where the bound is 0 and the value is not, as a percentage says nothing there.
    """
    for name, value in (("found", found), ("bound", bound)):
        if as_floats(name, value).ndim:
            raise InputError(name, value, "a number")
    if bound == 0:
        return 0.0 if found == 0 else float("nan")
    return 100.0 * abs(bound - found) / abs(bound)
