"""One thread for linear algebra, where matrices are small and threads only wait for another."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
T = TypeVar("T")


def one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function so that linear algebra within it runs on one thread.

    The limit ends with the function; libraries that are loaded within it are not limited.
    """

    @wraps(function)
    def limited(*arguments: P.args, **keywords: P.kwargs) -> T:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*arguments, **keywords)

    return limited
