"""Optima to many digits, and their numbers recognised as roots of polynomials, or in a field.

Newton's method computes residuals to all digits, and inverses in double precision. A relation
between numbers, with integer coefficients, is sought with nine tenths of the digits. It is
accepted if its coefficients have less than three quarters of these digits, and if it holds to
all.

J is a Jacobian, shape (m, n), t its squared worst case, θ the generator of a number field.
Numbers of many digits are `mpmath.mpf`, arrays of them have the dtype object; both are typed
`Any`. The number of digits is `mp.mp.dps`, which `exact_search` sets. Polynomials are lists of
integer coefficients, constant first. PARI/GP (`cypari`) finds the relations.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import mpmath as mp
import numpy as np
import scipy.optimize
from cypari import pari

from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.atlas.local_maximum import Conditions, LocalMaximum
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray

# Number of choices of the active sets that are tried, see `Conditions`.
_CHOICES = 4
# Smallest multiplier, as a share of the mean one, where all are to be positive.
_LEAST_SHARE = 1e-3
# Largest residual of these multipliers: the Jacobian on file is not exact.
_LARGEST_RESIDUAL = 1e-4
# Degrees of the polynomials that are tried, one after the other.
_DEGREES = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32)
# Largest degree of a field in which an exact proof is tried.
_LARGEST_FIELD = 10
# Number of digits at the end that Newton's method need not reach.
_LOST_DIGITS = 8
# Residual above which Newton's method is given up.
_DIVERGED = 10
# Singular values below this share of the largest count as zero in pseudo-inverses, which are in
# double precision: of a product A Aᵀ, and of second derivatives at an optimum. A larger share
# may drop a direction that is needed; with a smaller one rounding counts as a direction, and
# Newton's method diverges.
_RANK_OF_PRODUCT = 1e-12
_RANK_OF_SLOPE = 1e-10
# Number of digits at the end that a relation need not hold to.
_RELATION_LOST_DIGITS = 15
# A number below 10^(−digits/2) counts as zero, see `small`. Two numbers that differ by less
# than 10^(−digits/3) are one.
_ZERO_PART = 2
_SAME_PART = 3
# Largest number of steps with which the roots of a polynomial are computed, and the bits that
# are added to the working precision for each bit of it.
_ROOT_STEPS = 2000
_ROOT_PRECISION_FACTOR = 4
# Number of digits of a number in a message.
_MESSAGE_DIGITS = 12
# Share of the digits with which a relation is sought.
_SOUGHT_SHARE = 0.9
# Share of these digits that the coefficients of a relation may have: more is chance.
_LARGEST_SHARE = 0.75

#: Numbers of many digits from an array of numbers.
numbers = np.frompyfunc(mp.mpf, 1, 1)


def refined(
    residual: Callable[[Any], Any], step: Callable[[FloatArray], Any], start: Any
) -> Any:
    """Return where a residual vanishes to all digits, or raise ArithmeticError.

    Both functions map vectors to vectors: `residual` in numbers of many digits, `step` from a
    residual in double precision to the change of x that Newton's method subtracts.
    """
    x = start
    for _ in range(mp.mp.dps):
        rest = residual(x)
        largest = max(abs(v) for v in rest)
        if largest < mp.mpf(10) ** (_LOST_DIGITS - mp.mp.dps):
            return x
        if largest > _DIVERGED:
            break
        # The residual is scaled to size 1 first: doubles are not smaller than 1e-308.
        x = x - largest * step((rest / largest).astype(float))
    raise ArithmeticError("Newton's method does not converge")


def nearest_solution(matrix: Any, right: Any, start: Any) -> Any:
    """Return the solution x of matrix @ x = right that is nearest to a start.

    Shapes are (e, k), (e,) and (k,). Steps are in the row space, so the rest of the start
    stays.
    """
    inverse = np.linalg.pinv(
        (matrix @ matrix.T).astype(float), rcond=_RANK_OF_PRODUCT, hermitian=True
    )
    return refined(
        lambda x: matrix @ x - right, lambda rest: matrix.T @ numbers(inverse @ rest), start
    )


def solution(page: EntryPage, maximum: LocalMaximum | None) -> tuple[Any, Any]:
    """Return J and t of the optimum next to an entry, or raise ArithmeticError."""
    refused = ArithmeticError("no conditions")
    for choice in range(_CHOICES):
        try:
            kind = Conditions if maximum else _AllTied
            conditions = kind(page.entry, page.jacobian, choice)
            if maximum and not np.array_equal(conditions.kept, maximum.kept):
                continue
            x = conditions.solution()
            # Multipliers that are not unique leave a null space; steps are normal to it.
            inverse = np.linalg.pinv(conditions.slope(x), rcond=_RANK_OF_SLOPE)
            zero = refined(
                partial(_gradient, conditions), partial(np.matmul, inverse), numbers(x)
            )
            j, _, _, t, _ = conditions.parts(zero)
        except (ArithmeticError, CertificateError, np.linalg.LinAlgError) as error:
            refused = ArithmeticError(str(error))
        else:
            return j, t
    raise refused


def _gradient(conditions: Conditions, x: Any) -> Any:
    """Return what `Conditions.gradient` does, shape (N,), to all digits."""
    j, p, w, t, mu = conditions.parts(x)
    model = conditions.model
    levels = numbers(np.array([one.level for one in model]))
    linear = numbers(np.array([one.linear for one in model]))
    frames, kept = numbers(conditions.frames), numbers(conditions.kept)
    normals = linear.copy()  # ∇h_k = Hj + ℓ, a row for each condition
    for row, one in zip(normals, model, strict=True):
        places, others = np.nonzero(one.form)  # at most one in a row
        row[places] = row[places] + numbers(one.form[places, others]) * j.ravel()[others]
    rest = j * kept[:, None]
    pulled = np.sum(p[:, :, None] * rest, axis=1)  # J_F̄ᵀp_F, shape (|S|, n)
    by_j = 2 * p.T @ pulled + (w @ normals).reshape(j.shape)
    by_j = by_j - np.sum(mu[:, None, None] * frames, axis=0)
    by_p = 2 * (np.sum(rest * pulled[:, None], axis=2) - t * p)
    by_w = (normals + linear) @ j.ravel() / 2 - levels  # h_k = ½ jᵀHj + ℓ·j − c
    by_mu = -np.sum(frames * (j - numbers(conditions.fixed)), axis=(1, 2))
    return np.concatenate([by_j.ravel(), by_p.ravel(), by_w, [1 - np.sum(p * p)], by_mu])


class _AllTied(Conditions):
    """First-order conditions with positive multipliers of all sets at the worst case."""

    def multipliers(self, columns: FloatArray, choice: int) -> FloatArray:  # noqa: ARG002
        size = columns.shape[1]
        right = np.eye(len(columns))[-1]
        result = scipy.optimize.lsq_linear(columns, right, (_LEAST_SHARE / size, np.inf))
        if np.linalg.norm(result.fun) > _LARGEST_RESIDUAL:
            raise CertificateError("some multipliers are zero")
        return np.asarray(result.x)


def small(part: int) -> Any:
    """Return 10^(−digits // part), which counts as zero: −digits/part is rounded down."""
    return mp.mpf(10) ** (-mp.mp.dps // part)


def relation(values: Sequence[Any]) -> list[int] | None:
    """Return integers c with Σ c_i x_i = 0, None if none is significant."""
    digits = mp.mp.dps
    sought = _SOUGHT_SHARE * digits
    row = pari([pari(mp.nstr(value, digits)) for value in values])
    coefficients = [int(v) for v in row.lindep(int(sought))]
    size = sum(len(str(abs(v))) for v in coefficients)
    rest = abs(mp.fsum(a * x for a, x in zip(coefficients, values, strict=True)))
    scale = max(map(abs, coefficients)) * mp.fsum(map(abs, values))
    holds = rest < mp.mpf(10) ** (_RELATION_LOST_DIGITS - digits) * scale
    return coefficients if holds and size < _LARGEST_SHARE * sought else None


def algebraic(x: Any, degrees: Sequence[int] = _DEGREES) -> list[int]:
    """Return the irreducible integer polynomial of a number, or raise ArithmeticError."""
    for degree in degrees:
        coefficients = relation([x**i for i in range(degree + 1)])
        if coefficients is not None:
            factors = pari(coefficients[::-1]).Pol().factor()[0]
            parts = [[int(v) for v in one.Vecrev()] for one in factors]
            best = min(parts, key=lambda one: abs(mp.polyval(one[::-1], x)))
            return best if best[-1] > 0 else [-v for v in best]
    raise ArithmeticError(f"no relation of a degree up to {degrees[-1]}")


class NumberTable:
    """Numbers of a field on the basis 1, θ, θ², …, each once.

    `values` has each number to many digits; `numbers` has the same as integers: its
    coefficients on the basis, and last their common denominator.
    """

    def __init__(self, theta: Any, degree: int) -> None:
        self.powers = [theta**i for i in range(degree)]
        self.values: list[Any] = []
        self.numbers: list[list[int]] = []

    def place(self, x: Any) -> int:
        """Return the place of a number, recognised where it is new, or ArithmeticError."""
        for place, known in enumerate(self.values):
            if abs(x - known) < small(_SAME_PART):
                return place
        number = [0] * len(self.powers) + [1]
        if abs(x) > small(_ZERO_PART):
            coefficients = relation([x, *self.powers])
            if coefficients is None or coefficients[0] == 0:
                raise ArithmeticError(f"{mp.nstr(x, _MESSAGE_DIGITS)} is not of the field")
            sign = -1 if coefficients[0] > 0 else 1
            number = [sign * v for v in coefficients[1:]] + [abs(coefficients[0])]
        self.values.append(x)
        self.numbers.append(number)
        return len(self.values) - 1

    def places(self, values: Any) -> Any:
        """Return the places of the entries of an array, in nested lists."""
        places = [self.place(x) for x in values.ravel()]
        return np.reshape(places, values.shape).tolist()


def fields(
    t: Any, polynomial: list[int], scalars: list[Any]
) -> Iterator[tuple[Any, list[int]]]:
    """Yield generators θ and their monic polynomials: of Q(t), or of a larger field."""
    degree = len(polynomial) - 1
    if degree == 1:
        yield mp.mpf(0), [0, 1]
    else:
        yield from _reduced(t, polynomial)
    # A field of the same or of twice the degree may contain t and all scalars: it is generated
    # by one of them, or by a sum with t.
    for multiple in (2, 1) if degree == 1 else (1, 2):
        size = multiple * degree
        if not 1 < size <= _LARGEST_FIELD:
            continue
        sums = [x + t for x in scalars] if multiple == 2 else []
        for x in [*scalars, *sums]:
            try:
                generator = algebraic(x, (size,))
            except ArithmeticError:
                continue
            if len(generator) - 1 == size and relation([t, *(x**i for i in range(size))]):
                yield from _reduced(x, generator)
                break


def _reduced(x: Any, polynomial: list[int]) -> Iterator[tuple[Any, list[int]]]:
    """Yield a generator of the same field with a small monic polynomial."""
    best = [int(v) for v in pari(polynomial[::-1]).Pol().polredbest().Vecrev()]
    extra = _ROOT_PRECISION_FACTOR * mp.mp.prec
    for theta in mp.polyroots(best[::-1], maxsteps=_ROOT_STEPS, extraprec=extra):
        real = mp.re(theta)
        powers = [real**i for i in range(len(best) - 1)]
        if abs(mp.im(theta)) < small(_ZERO_PART) and relation([x, *powers]):
            yield real, best
