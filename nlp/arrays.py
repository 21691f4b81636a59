"""Arrays: their type, checks of shape and finiteness, one thread for their linear algebra."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from numbers import Real
from threading import Lock
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
from threadpoolctl import ThreadpoolController

from lockedjoint.nlp.errors import LARGEST, InputError

#: An array of doubles of any shape.
FloatArray: TypeAlias = npt.NDArray[np.float64]
#: Largest entry of a matrix, and the inverse of the smallest: the fourth powers of larger ones
#: are too near the largest floating-point number.
LARGEST_ENTRY = 1e70
#: Where randomness comes from: a seed, a whole number of at least 0, or a generator.
Rng: TypeAlias = int | np.random.Generator
# The limit that `one_blas_thread` has set, once for each block that is open in any thread.
_open_blocks: list[Any] = []
# The lock of this list.
_LIMITING = Lock()


def finite_vector(argument: str, value: npt.ArrayLike, size: int) -> FloatArray:
    """Return `value` as a vector of `size` finite floats; InputError where it is none."""
    vector = as_floats(argument, value)
    if vector.shape != (size,):
        raise InputError(argument, f"an array of shape {vector.shape}", f"shape ({size},)")
    if not np.all(np.isfinite(vector)):
        raise InputError(argument, "an array with NaN or infinity", "finite numbers only")
    return vector


def as_floats(argument: str, value: npt.ArrayLike) -> FloatArray:
    """Return `value` as an array of floats; InputError where it is none.

    Complex numbers, booleans, dates and text that looks like numbers are refused, not cast, and
    so are masked entries.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:  # most often, and soonest
        return value
    if np.ma.is_masked(value):
        raise InputError(argument, "an array with masked entries", "an array without them")
    try:
        given = np.asarray(value)
        if given.dtype.kind in "fiu" or given.size == 0 or _all_real(given):
            with np.errstate(over="ignore"):  # infinity, which callers refuse
                return np.asarray(given, dtype=np.float64)
        found = f"an array of {given.dtype.name}"
    except Exception:  # whatever a foreign object raises that should become an array
        found = "an array with entries that are no floating-point numbers"
    raise InputError(argument, found, "an array of real numbers")


def _all_real(given: npt.NDArray[Any]) -> bool:
    """Whether an array of Python objects holds real numbers, and no truth values, only."""
    return given.dtype == object and all(
        isinstance(entry, Real) and not isinstance(entry, bool) for entry in given.flat
    )


def whole_number(argument: str, value: object, lowest: int, highest: int = LARGEST) -> int:
    """Return `value` if it is an integer in this range; InputError otherwise."""
    allowed = f"a whole number of at least {lowest}"
    if isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64):
        if lowest <= value <= highest:
            return int(value)
        allowed += f" and at most {highest}" if value > highest else ""
    raise InputError(argument, value, allowed)


def real_number(
    argument: str, value: object, allowed: str, least: float = -LARGEST, most: float = math.inf
) -> float:
    """Return a finite number in this range; InputError, which says what is allowed, if not."""
    number = isinstance(value, int | float | np.integer | np.floating)
    if number and not isinstance(value, bool | np.timedelta64):
        with suppress(OverflowError):
            found = float(cast(Any, value))
            if math.isfinite(found) and least <= found <= most:
                return found
    raise InputError(argument, value, allowed)


def check_length(argument: str, value: object) -> None:
    """Raise InputError unless the value is a number whose fourth power is finite and not 0."""
    allowed = f"a number from {1 / LARGEST_ENTRY:g} to {LARGEST_ENTRY:g}"
    real_number(argument, value, allowed, 1 / LARGEST_ENTRY, LARGEST_ENTRY)


def finite_or_none(value: float | None) -> float | None:
    """Return a number as a float, or None where there is none or it is not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def semidefinite_root(matrix: FloatArray) -> FloatArray:
    """Return R, of the shape of a symmetric matrix, with RRᵀ the nearest semidefinite one."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def nearest_semidefinite(matrix: FloatArray) -> FloatArray:
    """Return the positive semidefinite matrix nearest to a square one, in ‖·‖_F."""
    root = semidefinite_root(0.5 * (matrix + matrix.T))
    return np.asarray(root @ root.T)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Run linear algebra on one thread, within a block or as a decorator in a function.

    Matrices here are small: more threads would only wait for one another. The limit is the
    process's. It ends with the last block that is open in any thread; libraries that are loaded
    within it are not limited.
    """
    with _LIMITING:
        set_by = _open_blocks[:1] or [_blas(len(sys.modules)).limit(limits=1, user_api="blas")]
        _open_blocks.extend(set_by)
    try:
        yield
    finally:
        with _LIMITING:
            limits = _open_blocks.pop()
            if not _open_blocks:
                limits.restore_original_limits()


@lru_cache(maxsize=1)
def _blas(modules: int) -> ThreadpoolController:  # noqa: ARG001
    """Return what controls the libraries loaded so far.

    To look for them takes a millisecond. It does not know libraries that are loaded later, so
    it is kept only as long as the number of Python's modules stays the same.
    """
    return ThreadpoolController()
