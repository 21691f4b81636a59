"""A known optimum of max-min proved to be a strict local maximum, in whole numbers.

Columns j_i = (v_i; ω_i) of n unit revolute joints, A_f = JJᵀ − j_f j_fᵀ, t the least eigenvalue
of every A_f. With p_f = √y_f u_f, u_f the eigenvectors and y_f multipliers, the first-order
conditions say that the gradient F of the polynomial

    G = t(1 − Σ|p_f|²) + Σ p_fᵀA_f p_f − Σ (a_i(|v_i|² − 1) + b_i(|ω_i|² − 1) + 2c_i v_i·ω_i)
        − Σ_k μ_k ⟨g_k, J − J⁰⟩

is zero. The g_k are the changes of J⁰ by the three rotations of the frame and by the phase: J
is the one of its orbit that is nearest to J⁰ in these directions.

**A zero.** x⁰ is a double-precision solution, C the inverse of DF(x⁰) in double precision. F
has degree at most 2 in every single unknown, so that F(x⁰) and DF(x⁰) follow exactly from
values at whole numbers. If η ≥ |CF(x⁰)|, ρ ≥ ‖CDF(x⁰) − I‖ and κ ≥ ‖C‖ · sup ‖D²F‖ in the
maximum norm, and 2ηκ < (1 − ρ)², there is exactly one zero in |x − x⁰| < (1 − ρ)/κ, and it is
within 2η/(1 − ρ) (Newton–Kantorovich). There μ = 0: the rest of G does not change along orbits,
so that Σ_k μ_k ⟨g_k, g_l(J)⟩ = 0, and this matrix is regular near J⁰.

**A strict local maximum.** p_f ≠ 0 and A_f − tI + p_f p_fᵀ ≻ 0 say that every multiplier is
positive and t a simple least eigenvalue of A_f. Then DF = D²G, with 12n unknowns J, p and
3n + 5 constraints, has 9n + 4 positive and 6n + 1 negative eigenvalues exactly if the Hessian
of the Lagrangian Σ y_f λ_f is negative definite on the tangents at which all n eigenvalues λ_f
change alike, frame and phase fixed: eliminating what of p is orthogonal to p_f leaves
[[R, Cᵀ], [C, 0]] with n − 1 rows C. An inertia is that of VᵀSV, V eigenvectors in double
precision, by Gershgorin's discs. So no other J nearby, up to frame and phase, is as good.
"""

from dataclasses import asdict, dataclass
from math import sqrt
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from formulations import measures
from formulations.existence.certificate import CertificateError
from nlp.arrays import FloatArray

Integers: TypeAlias = npt.NDArray[np.object_]
# Unknowns are multiples of 2^−BITS; entries of C and of V, multiples of 2^−COARSE.
_BITS, _COARSE = 50, 30
_NEWTON_STEPS = 8
# The largest size of an unknown in the ball.
_LARGEST = 1.1
# Sums of up to a million positive doubles, and their rounding from whole numbers.
_SAFETY = 1 + 1e-9


@dataclass(frozen=True)
class LocalMaximum:
    """What was proved of a worst case."""

    #: Number n of unit revolute joints.
    joints: int
    #: t, the square of the worst case, to within `distance`.
    eigenvalue: float
    #: The true unknowns are not farther than this from the solution in double precision.
    distance: float
    #: Nothing else this near meets the first-order conditions, frame and phase fixed.
    uniqueness: float

    @property
    def sigma(self) -> float:
        """The worst case."""
        return sqrt(self.eigenvalue)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON."""
        return {**asdict(self), "sigma": self.sigma}


def prove_local_maximum(jacobian: npt.ArrayLike) -> LocalMaximum:
    """Prove that a strict local maximum of the worst case (5) is next to a Jacobian.

    Its entries differ by less than `LocalMaximum.uniqueness`.

    Parameters
    ----------
    jacobian
        Shape (6, n), n unit revolute joints; as good as double precision allows.

    Raises
    ------
    InputError
        If it is no matrix with more columns than rows.
    CertificateError
        If the proof does not succeed: because it is no strict local maximum modulo frame and
        phase, or failures of some joints are not the worst, or eigenvalues are not simple.
    """
    matrix = measures.as_jacobian(jacobian)
    n = matrix.shape[1]
    generators = _generators(matrix)
    start = _solution(matrix, generators)
    # The same in whole numbers, J⁰ and the g_k included.
    x, fixed, g = _whole(start), _whole(matrix), [_whole(one) for one in generators]
    one = 1 << _BITS
    value, slope = _gradient(x, fixed, g, one), _slope(x, fixed, g, one)
    inverse = _whole(np.asarray(np.linalg.inv(_floats(slope, 2)), dtype=float), _COARSE)
    eta = _size(inverse @ value, 3, coarse=1)
    excess = inverse @ slope - _unit(len(x)) * (one**2 << _COARSE)
    rho = _row_sum(excess, 2, coarse=1)
    # An entry of F: at most 36(n − 1) monomials of degree three, twice, and few of degree two.
    bend = 72 * (n - 1) * _LARGEST + 24
    kappa = _row_sum(inverse, 0, coarse=1) * bend * _SAFETY
    distance = 2 * eta / (1 - rho) * _SAFETY
    uniqueness = (1 - rho) / kappa / _SAFETY
    _require(rho < 0.5 and distance < uniqueness / 2, "no solution is proved to be near")
    moved = float(np.abs(start[: 6 * n] - matrix.ravel()).max())
    _require(moved + distance < uniqueness, "the solution found is another Jacobian")
    _require(_size(x, 1) + uniqueness < _LARGEST, "an unknown is too large")
    change = bend * distance
    jacobians, p, _, t, _ = _parts(x, n)
    for f in range(n):
        kept = jacobians @ jacobians.T - np.outer(jacobians[:, f], jacobians[:, f])
        shifted = kept - t * one * _unit(6) + np.outer(p[:, f], p[:, f])
        _require(_inertia(shifted, change) == (6, 0), f"failure {f} is not simply the worst")
        _require(_size(p[:, f], 1) > 10 * distance, f"the multiplier of failure {f} is zero")
    gram = np.array([[np.sum(a * b) for b in _generators(jacobians)] for a in g], dtype=object)
    _require(_inertia(gram, change) == (4, 0), "frame and phase are not fixed")
    _require(_inertia(slope, change) == (9 * n + 4, 6 * n + 1), "it is no strict maximum")
    return LocalMaximum(n, float(start[15 * n]), distance, uniqueness)


def _parts(x: Any, n: int) -> tuple[Any, Any, Any, Any, Any]:
    """Return J, p, the multipliers (a, b, c), t and μ."""
    j, p, abc = np.split(x[: 15 * n], [6 * n, 12 * n])
    return j.reshape(6, n), p.reshape(6, n), abc.reshape(3, n), x[15 * n], x[15 * n + 1 :]


def _generators(jacobian: Any) -> list[Any]:
    """Return the changes of J by rotations about the three axes, and by the phase."""
    v, w = jacobian[:3], jacobian[3:]
    axes = np.eye(3, dtype=int)[:, :, None]
    turned = [np.vstack([np.cross(axis, part, axis=0) for part in (v, w)]) for axis in axes]
    return [*turned, np.vstack([-w, v])]


def _gradient(x: Any, fixed: Any, generators: list[Any], one: Any) -> Any:
    """Return F, times `one`³ where the unknowns and all else are times `one`."""
    n = fixed.shape[1]
    j, p, (a, b, c), t, mu = _parts(x, n)
    v, w = j[:3], j[3:]
    by_j = 2 * ((p @ p.T) @ j - p * np.sum(p * j, axis=0))
    by_j = by_j - 2 * one * np.vstack([a * v + c * w, b * w + c * v])
    by_j = by_j - one * sum(m * g for m, g in zip(mu, generators, strict=True))
    by_p = 2 * ((j @ j.T) @ p - j * np.sum(j * p, axis=0) - one * t * p)
    lengths = [one**2 - np.sum(part * part, axis=0) for part in (v, w)]
    by_abc = one * np.concatenate([*lengths, -2 * np.sum(v * w, axis=0)])
    by_t = one * (one**2 - np.sum(p * p))
    by_mu = [-one * np.sum(g * (j - fixed)) for g in generators]
    return np.concatenate([by_j.ravel(), by_p.ravel(), by_abc, [by_t], by_mu])


def _slope(x: Any, fixed: Any, generators: list[Any], one: Any) -> Any:
    """Return DF, times `one`², exactly: F is quadratic in every single unknown."""
    columns = []
    for unit in _unit(len(x)).astype(x.dtype):
        above, below = (_gradient(x + s * one * unit, fixed, generators, one) for s in (1, -1))
        columns.append((above - below) // (2 * one) if one != 1 else (above - below) / 2)
    return np.array(columns).T


def _solution(jacobian: FloatArray, generators: list[FloatArray]) -> FloatArray:
    """Return the unknowns in double precision, by Newton's method."""
    n = jacobian.shape[1]
    each = np.eye(n)
    kept = jacobian * (1 - each)[:, None]
    values, vectors = np.linalg.eigh(kept @ kept.swapaxes(1, 2))
    t, u = values[:, 0].min(), vectors[:, :, 0].T
    # Multipliers y, a, b, c: gradients of t on one side, normals of the model on the other.
    gradients = u.T[:, :, None] * (u.T[:, None] @ kept)
    zero = np.zeros_like(jacobian[:3])
    v, w = jacobian[:3], jacobian[3:]
    normals = [np.vstack(both) for both in ((v, zero), (zero, w), (w, v))]
    columns = [*gradients, *(-normal * unit for normal in normals for unit in each)]
    system = np.vstack([np.reshape(columns, (4 * n, -1)).T, np.arange(4 * n) < n])
    y = np.linalg.lstsq(system, np.append(np.zeros(6 * n), 1.0), rcond=None)[0]
    _require(bool(np.all(y[:n] > 0)), "multipliers are not positive")
    x = np.concatenate(
        [jacobian.ravel(), (u * np.sqrt(y[:n])).ravel(), y[n:], [t], np.zeros(4)]
    )
    for _ in range(_NEWTON_STEPS):
        slope = _slope(x, jacobian, generators, 1)
        x = x - np.linalg.lstsq(slope, _gradient(x, jacobian, generators, 1), rcond=None)[0]
    return np.asarray(x)


def _inertia(matrix: Any, change: float) -> tuple[int, int] | None:
    """Return how many eigenvalues are positive and negative, None if that is not proved.

    They are those of all symmetric matrices whose rows differ from this one, which is times
    2^(2·BITS), by at most `change` in the sum of absolute values.
    """
    vectors = np.linalg.eigh(_floats(matrix, 2))[1]
    v = _whole(vectors, _COARSE)
    product = v.T @ matrix @ v
    diagonal = np.diag(product)
    widths = np.array([_row_sum(row[None], 2, coarse=2) for row in product - np.diag(diagonal)])
    # ‖V‖ and ‖Vᵀ‖ are at most the number of rows.
    centres = _floats(diagonal, 2, coarse=2)
    clear = np.abs(centres) > _SAFETY * (widths + len(matrix) ** 2 * change)
    return (int(np.sum(centres > 0)), int(np.sum(centres < 0))) if clear.all() else None


def _whole(values: FloatArray, bits: int = _BITS) -> Integers:
    """Return the nearest whole multiples of 2^−bits."""
    rounded = [round(float(value) * 2**bits) for value in values.ravel()]
    return np.array(rounded, dtype=object).reshape(values.shape)


def _floats(numbers: Any, power: int, coarse: int = 0) -> FloatArray:
    """Return whole numbers over 2^(power · BITS + coarse · COARSE)."""
    scale = 1 << (power * _BITS + coarse * _COARSE)
    return np.array([number / scale for number in numbers.ravel()]).reshape(numbers.shape)


def _unit(size: int) -> Integers:
    return np.eye(size, dtype=int).astype(object)


def _size(vector: Any, power: int, coarse: int = 0) -> float:
    """Return the largest absolute value, rounded up."""
    return _SAFETY * float(np.abs(_floats(vector, power, coarse)).max())


def _row_sum(matrix: Any, power: int, coarse: int = 0) -> float:
    """Return the largest sum of absolute values in a row, rounded up."""
    return _SAFETY * float(np.abs(_floats(matrix, power, coarse)).sum(axis=1).max())


def _require(condition: bool, why: str) -> None:
    if not condition:
        raise CertificateError(f"not proved to be a strict local maximum: {why}.")
