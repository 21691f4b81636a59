"""The worst failure: of one Jacobian, and of many at once with its gradient.

J is a Jacobian, shape (m, n) with n > m, one column per joint, counted from 0. A single failure
f removes column f; J_F is what is left of J. σ is the smallest singular value that the worst
failure leaves (eq. 5), in units of J, with the singular vectors u, shape (m,), and v, shape
(n,): Jv = σu with v_f = 0. A stack has N Jacobians, shape (N, m, n).

In formulas J = U S Vᵀ with singular values s_1 ≥ … ≥ s_m, and V_fi is the entry of V in the row
of joint f and the column of s_i; λ is the least eigenvalue of JJᵀ − jjᵀ, so that σ² = λ.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.formulations.measures.jacobian import (
    as_jacobian,
    locked_sets,
    locked_singular_values,
)
from lockedjoint.nlp.arrays import LARGEST_ENTRY, FloatArray, as_floats
from lockedjoint.nlp.errors import InputError

#: Failures tie when they leave the same to this share of it, or of the largest entry of J.
TIE = 1e-6
#: Share of the largest eigenvalue above which the least of JJᵀ − jjᵀ tells which failure is the
#: worst. Below it forming JJᵀ has cost too many digits, and J itself is decomposed.
FAR_FROM_SINGULAR = 1e-8
# Factor on this share for a single Jacobian: nearer to singular it is done by the slower way.
_MARGIN = 10
# Share of the cube of the largest eigenvalue. If the least eigenvalue times the square of its
# gap is above it, σ from the eigenvector is right to 1e-12 of the largest.
_SURE = 1e-19
# Share by which bounds of a failure may be off by rounding.
_BOUND_ERROR = 1e-6
# The same of the bounds that are computed here. A larger share keeps more failures to be tried.
_OWN_BOUND_ERROR = 1e-9
# Largest number of steps of Newton's method, which converges in about ten.
_NEWTON_STEPS = 100
# Newton's method ends where a step is at most this share of the root: a few roundings.
_NEWTON_TOLERANCE = 1e-15
# A root this large counts as infinite.
_NO_ROOT = 1e150
# A slope this small counts as none.
_NO_SLOPE = 1e-300


@dataclass(frozen=True, eq=False, repr=False)
class WorstCase(Brief):
    """The worst set of locked joints.

    Attributes
    ----------
    sigma
        Smallest singular value that is left (eq. 5).
    joints
        The locked joints that leave it, counted from 0; the first such set on a tie.
    sets
        Every set of locked joints that leaves no more than that, to a relative `TIE`.
    direction
        End-effector direction that suffers most when `joints` lock, a unit vector of shape
        (m,) (eq. 15), its largest entry positive.
    """

    sigma: float
    joints: tuple[int, ...]
    sets: tuple[tuple[int, ...], ...]
    direction: FloatArray

    def to_dict(self) -> dict[str, object]:
        """Return plain values for tables and JSON."""
        return {
            "sigma": self.sigma,
            "joints": list(self.joints),
            "sets": [list(joints) for joints in self.sets],
            "direction": self.direction.tolist(),
        }


def worst_case_sigma(jacobian: npt.ArrayLike, failures: int = 1) -> float:
    """Return the worst case of σ_m over all sets of `failures` joints that lock (eq. 5)."""
    return float(np.min(locked_singular_values(jacobian, failures)))


def worst_case(jacobian: npt.ArrayLike, failures: int = 1) -> WorstCase:
    """Return the worst set of `failures` joints, and what it hurts most (eqs. 5 and 15)."""
    matrix = as_jacobian(jacobian)
    sets, sigmas = locked_sets(matrix, failures), locked_singular_values(matrix, failures)
    worst = int(np.argmin(sigmas))
    limit = sigmas[worst] + TIE * max(float(sigmas[worst]), float(np.max(np.abs(matrix))))
    tied = tuple(joints for joints, sigma in zip(sets, sigmas, strict=True) if sigma <= limit)
    direction = weakest_direction(np.delete(matrix, sets[worst], axis=1))
    return WorstCase(float(sigmas[worst]), sets[worst], tied, direction)


def weakest_direction(matrix: FloatArray) -> FloatArray:
    """Return the left singular vector of the smallest singular value, shape (m,).

    Its largest entry in magnitude is positive.
    """
    matrix = as_floats("matrix", matrix)
    if matrix.ndim != 2 or not len(matrix) or not np.all(np.isfinite(matrix)):
        raise InputError("matrix", f"of shape {matrix.shape}", "a matrix of finite numbers")
    direction = np.linalg.svd(matrix)[0][:, -1]
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))])) + 0.0


@dataclass(frozen=True, eq=False, repr=False)
class WorstCases(Brief):
    """The worst single failure of each of N Jacobians.

    Attributes
    ----------
    sigma
        Smallest singular value that is left (eq. 5), shape (N,).
    joint
        The joint that has locked, counted from 0; one of them on a tie, shape (N,).
    left, right
        Singular vectors u, shape (N, m), and v, shape (N, n), which is 0 at that joint:
        u = `direction` of `WorstCase` up to its sign.
    """

    sigma: FloatArray
    joint: npt.NDArray[np.intp]
    left: FloatArray
    right: FloatArray

    @property
    def gradient(self) -> FloatArray:
        """∂σ/∂J = u vᵀ, shape (N, m, n).

        Where failures tie, or the smallest singular value that one of them leaves is
        repeated, σ has a kink: this is a generalised gradient (Clarke), that of
        one of the functions whose least σ is. So it is where σ = 0.
        """
        return self.left[:, :, None] * self.right[:, None, :]


def worst_case_sigma_batch(jacobians: npt.ArrayLike) -> WorstCases:
    """Return the worst case over single failures of many Jacobians at once (eq. 5).

    Each is decomposed once, J = U S Vᵀ. For each failure f the least eigenvalue λ of JJᵀ − jjᵀ,
    j the locked column, is the root of

        Σ_{i>m} V_fi² = λ Σ_{i≤m} V_fi² / (s_i² − λ)    in [0, s_m²],

    in which nothing is subtracted that could cancel. Its eigenvector is U w,
    w_i = V_fi s_i / (s_i² − λ).

    Parameters
    ----------
    jacobians
        Shape (N, m, n), n > m.

    Raises
    ------
    InputError
        If the shape is another, or an entry is not finite or beyond `LARGEST_ENTRY`.
    """
    stack = checked_stack(jacobians)
    worst, sure = _by_eigenvalues(stack)
    doubtful = np.flatnonzero(~sure)
    if doubtful.size:
        exact = _by_singular_values(stack[doubtful])
        for name in ("sigma", "joint", "left", "right"):
            getattr(worst, name)[doubtful] = getattr(exact, name)
    return worst


def checked_stack(jacobians: npt.ArrayLike) -> FloatArray:
    """Return Jacobians as an array of shape (N, m, n), n > m, or refuse them."""
    stack = as_floats("jacobians", jacobians)
    if stack.ndim != 3 or 0 in stack.shape[1:] or stack.shape[2] <= stack.shape[1]:
        allowed = "shape (N, m, n), with more joints n than task dimensions m"
        raise InputError("jacobians", f"an array of shape {stack.shape}", allowed)
    wrong = ~np.all(np.abs(stack) <= LARGEST_ENTRY, axis=(1, 2))  # NaN, too
    if np.any(wrong):
        allowed = f"finite entries of at most {LARGEST_ENTRY:g} in magnitude"
        raise InputError(
            f"Jacobian {int(np.argmax(wrong))}", "not finite or too large", allowed
        )
    return stack


def _by_eigenvalues(stack: FloatArray) -> tuple[WorstCases, npt.NDArray[np.bool_]]:
    """Return the worst cases from JJᵀ = U S² Uᵀ, in half the time, and which are sure.

    The second array, shape (N,), is False where forming JJᵀ may have cost digits: u is right to
    the error of the eigenvalues over their distance, and σ = |J_Fᵀu| to its square.
    """
    turned = stack.transpose(0, 2, 1)
    values, outer = np.linalg.eigh(stack @ turned)  # s_i² ascending, shape (N, m), and U
    tiny = np.finfo(float).tiny
    least, largest = np.maximum(values[:, 0], tiny), np.maximum(values[:, -1], tiny)
    ratios = least[:, None] / np.maximum(values, tiny)  # s_m²/s_i²
    scaled = outer.transpose(0, 2, 1) @ stack  # UᵀJ = S Vᵀ
    inner = scaled / np.sqrt(np.maximum(values, tiny))[:, :, None]  # Vᵀ, shape (N, m, n)
    squares = inner**2
    joint, rest = _worst_downdate(
        squares, ratios, np.maximum(1.0 - np.sum(squares, axis=1), 0.0)
    )
    each = np.arange(len(stack))
    # w of `worst_case_sigma_batch`, scaled to length 1.
    weights = inner[each, :, joint] * np.sqrt(ratios) / (1.0 + rest[:, None] * (1.0 - ratios))
    weights /= np.sqrt(np.sum(weights**2, axis=1) + tiny)[:, None]
    left = (outer @ weights[:, :, None])[:, :, 0]
    right = (left[:, None, :] @ stack)[:, 0, :]
    right[each, joint] = 0.0
    sigma = np.sqrt(np.sum(right**2, axis=1))
    share = least / largest * rest / (1.0 + rest)  # λ over the largest eigenvalue
    apart = least / largest - share  # the second least after the failure is not below λ_m
    sure = (share > FAR_FROM_SINGULAR) & (apart**2 * share > _SURE)
    return WorstCases(sigma, joint, left, right / np.maximum(sigma, tiny)[:, None]), sure


def _by_singular_values(stack: FloatArray) -> WorstCases:
    """Return the worst cases from J = U S Vᵀ, and then from J without its worst column.

    It is slower, and nothing small is lost in either decomposition.
    """
    count, m, n = stack.shape
    _, sigmas, inner = np.linalg.svd(stack)
    least = np.maximum(sigmas, np.finfo(float).tiny ** 0.5)
    squares = inner**2
    joint, _ = _worst_downdate(
        squares[:, :m], (least[:, -1:] / least) ** 2, np.sum(squares[:, m:], axis=1)
    )
    each = np.arange(count)
    others = np.array([np.delete(np.arange(n), f) for f in range(n)])[joint]
    without = np.take_along_axis(stack, others[:, None, :], axis=2)
    left, sigmas, rows = np.linalg.svd(without, full_matrices=False)
    right = np.zeros((count, n))
    right[each[:, None], others] = rows[:, -1]
    return WorstCases(sigmas[:, -1], joint, left[:, :, -1], right)


def worst_case_of_one(
    jacobian: FloatArray, bounds: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return σ, u and v of `worst_case_sigma_batch` for one Jacobian, without its checks.

    `bounds` are lower and upper bounds of 1/λ for each failure, as rows, shape (2, n), λ the
    least eigenvalue of JJᵀ − jjᵀ. It is computed for those failures that can be the worst by
    them. σ is then |J_Fᵀu|, right to the square of the error of u.
    """
    square, decomposed = jacobian @ jacobian.T, dsyev()
    lower, upper = bounds.tolist()
    limit = max(lower) * (1 - _BOUND_ERROR)
    joint, values, left = -1, [math.inf], jacobian[:, 0]
    for f in [f for f, bound in enumerate(upper) if bound >= limit]:
        column = jacobian[:, f]
        found, vectors, _ = decomposed(square - column[:, None] * column)
        if found[0] < values[0]:
            joint, values, left = f, found.tolist(), vectors[:, 0]
    least, largest = values[0], values[-1]
    gap = values[1] - least if len(values) > 1 else largest
    # The error of u is that of the eigenvalues over their distance.
    if joint < 0 or not (
        least > _MARGIN * FAR_FROM_SINGULAR * largest and gap**2 * least > _SURE * largest**3
    ):
        worst = worst_case_sigma_batch(jacobian[None])
        return float(worst.sigma[0]), worst.left[0], worst.right[0]
    right = left @ jacobian
    right[joint] = 0.0
    sigma = math.sqrt(right @ right)
    return sigma, left, right / sigma


@cache
def dsyev() -> Callable[..., Any]:
    """Return SciPy's `dsyev`, LAPACK's eigenvalues and vectors of one symmetric matrix.

    It takes half the time that NumPy takes, and can write in place.
    """
    from scipy.linalg import lapack

    return cast(Callable[..., Any], lapack.dsyev)


def _worst_downdate(
    squares: FloatArray, ratios: FloatArray, null: FloatArray
) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Return the joint with the least t = λ/(s_m² − λ) of `worst_case_sigma_batch`, and t.

    t is the root of H(t) = Σ_i V_fi² r_i t / (1 + t x_i) = Σ_{i>m} V_fi², r_i = s_m²/s_i²,
    x_i = 1 − r_i. With A = Σ V_fi² r_i and x̄ the mean of x_i with these weights,
    A t/(1 + t x̄) ≤ H(t) ≤ A t (Jensen), which leaves few joints. For these Newton's method:
    H is increasing and concave, so that from below all steps stay below the root.

    Parameters
    ----------
    squares, ratios, null
        V_fi² for i ≤ m, shape (N, m, n); r_i, shape (N, m); Σ_{i>m} V_fi², shape (N, n).
    """
    size = (ratios[:, None, :] @ squares)[:, 0, :]
    slack = 1.0 - ratios
    bent = ((ratios * slack)[:, None, :] @ squares)[:, 0, :]
    lowest = np.minimum(null / np.maximum(size, _NO_SLOPE), _NO_ROOT)
    limit = size - lowest * bent
    highest = np.where(limit > 0, null / np.maximum(limit, _NO_SLOPE), np.inf)
    few = lowest <= np.min(highest, axis=1, keepdims=True) * (1 + _OWN_BOUND_ERROR)
    row, joint = np.nonzero(few)
    scaled, slack, target = squares[row, :, joint] * ratios[row], slack[row], null[row, joint]
    roots = lowest[row, joint]
    for _ in range(_NEWTON_STEPS):
        below = 1.0 + roots[:, None] * slack
        terms = scaled / below
        slope = np.einsum("ki,ki->k", terms, 1.0 / below)
        step = (target - roots * np.sum(terms, axis=1)) / np.maximum(slope, _NO_SLOPE)
        roots = np.minimum(roots + np.maximum(step, 0.0), _NO_ROOT)
        if np.all(step <= _NEWTON_TOLERANCE * roots):
            break
    root = np.full(null.shape, np.inf)
    root[row, joint] = roots
    worst = np.argmin(root, axis=1)
    return worst, root[np.arange(len(root)), worst]
