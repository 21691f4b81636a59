"""Optima to many digits, and their numbers recognised: as roots of polynomials, and in a field.

Residuals have all digits, inverses are in double precision. Relations in whole numbers are
sought with all but the last tenth of the digits, must have a quarter fewer themselves, and must
hold to all of them.
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

_CHOICES = 4
# Multipliers are at least this share of the mean one, where all are to be above zero.
_LEAST = 1e-3
_DEGREES = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32)
# Degrees of the fields that exact proofs are tried in.
_LARGEST = 10

numbers = np.frompyfunc(mp.mpf, 1, 1)


def refined(
    residual: Callable[[Any], Any], step: Callable[[FloatArray], Any], start: Any
) -> Any:
    """Return where a residual vanishes to all digits, or raise ArithmeticError."""
    x = start
    for _ in range(mp.mp.dps):
        rest = residual(x)
        largest = max(abs(v) for v in rest)
        if largest < mp.mpf(10) ** (8 - mp.mp.dps):
            return x
        if largest > 10:
            break
        x = x - largest * step((rest / largest).astype(float))
    raise ArithmeticError("Newton's method does not converge")


def nearest_solution(matrix: Any, right: Any, start: Any) -> Any:
    """Return the solution of linear equations that is nearest to a start."""
    inverse = np.linalg.pinv((matrix @ matrix.T).astype(float), rcond=1e-12, hermitian=True)
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
            inverse = np.linalg.pinv(conditions.slope(x), rcond=1e-10)
            residual = partial(conditions.gradient_in, numbers)
            found = refined(residual, partial(np.matmul, inverse), numbers(x))
            j, _, _, t, _ = conditions.parts(found)
        except (ArithmeticError, CertificateError, np.linalg.LinAlgError) as error:
            refused = ArithmeticError(str(error))
        else:
            return j, t
    raise refused


class _AllTied(Conditions):
    """All sets at the worst case have multipliers above zero, so that all are equations."""

    def multipliers(self, columns: FloatArray, choice: int) -> FloatArray:  # noqa: ARG002
        size = columns.shape[1]
        sought = np.eye(len(columns))[-1]
        found = scipy.optimize.lsq_linear(columns, sought, (_LEAST / size, np.inf))
        # What is on file is not exact.
        if np.linalg.norm(found.fun) > 1e-4:
            raise CertificateError("some multipliers are zero")
        return np.asarray(found.x)


def small(share: int) -> Any:
    """Return ten to the minus `digits/share`."""
    return mp.mpf(10) ** (-mp.mp.dps // share)


def relation(values: Sequence[Any]) -> list[int] | None:
    """Return whole numbers c with Σ c_i x_i = 0, None if none is significant."""
    digits = mp.mp.dps
    rows = [pari(mp.nstr(value, digits)) for value in values]
    c = [int(v) for v in pari(rows).lindep(int(0.9 * digits))]
    size = sum(len(str(abs(v))) for v in c)
    left = abs(mp.fsum(a * x for a, x in zip(c, values, strict=True)))
    fits = left < mp.mpf(10) ** (15 - digits) * max(map(abs, c)) * mp.fsum(map(abs, values))
    return c if fits and size < 0.75 * 0.9 * digits else None


def algebraic(x: Any, degrees: Sequence[int] = _DEGREES) -> list[int]:
    """Return the irreducible polynomial in whole numbers of a number, or ArithmeticError."""
    for degree in degrees:
        c = relation([x**i for i in range(degree + 1)])
        if c is not None:
            factors = pari(c[::-1]).Pol().factor()[0]
            parts = [[int(v) for v in one.Vecrev()] for one in factors]
            best = min(parts, key=lambda one: abs(mp.polyval(one[::-1], x)))
            return best if best[-1] > 0 else [-v for v in best]
    raise ArithmeticError(f"no relation of a degree up to {degrees[-1]}")


class Pool:
    """Numbers of a field on the basis 1, θ, …, each once."""

    def __init__(self, theta: Any, degree: int) -> None:
        self.powers = [theta**i for i in range(degree)]
        self.values: list[Any] = []
        self.numbers: list[list[int]] = []

    def place(self, x: Any) -> int:
        """Return the place of a number, recognised where it is new, or ArithmeticError."""
        for place, known in enumerate(self.values):
            if abs(x - known) < small(3):
                return place
        stated = [0] * len(self.powers) + [1]
        if abs(x) > small(2):
            c = relation([x, *self.powers])
            if c is None or c[0] == 0:
                raise ArithmeticError(f"{mp.nstr(x, 12)} is not of the field")
            side = -1 if c[0] > 0 else 1
            stated = [side * v for v in c[1:]] + [abs(c[0])]
        self.values.append(x)
        self.numbers.append(stated)
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
    # Numbers whose polynomials are small, and of which t is one.
    for multiple in (2, 1) if degree == 1 else (1, 2):
        size = multiple * degree
        if not 1 < size <= _LARGEST:
            continue
        sums = [x + t for x in scalars] if multiple == 2 else []
        for x in [*scalars, *sums]:
            try:
                own = algebraic(x, (size,))
            except ArithmeticError:
                continue
            if len(own) - 1 == size and relation([t, *(x**i for i in range(size))]):
                yield from _reduced(x, own)
                break


def _reduced(x: Any, polynomial: list[int]) -> Iterator[tuple[Any, list[int]]]:
    """Yield a generator of the same field with a small monic polynomial."""
    best = [int(v) for v in pari(polynomial[::-1]).Pol().polredbest().Vecrev()]
    for theta in mp.polyroots(best[::-1], maxsteps=2000, extraprec=4 * mp.mp.prec):
        real = mp.re(theta)
        powers = [real**i for i in range(len(best) - 1)]
        if abs(mp.im(theta)) < small(2) and relation([x, *powers]):
            yield real, best
