"""The studies by name, in the order in which they run: where a new one is listed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from formulations.studies import existence, figures, reproduction
from formulations.studies.benchmark import study as benchmark
from formulations.studies.bounds import study as bounds
from formulations.studies.comparison import study as comparison
from formulations.studies.failures import study as failures
from formulations.studies.robots import study as robots
from formulations.studies.study import Study
from nlp.errors import InputError

STUDIES: Mapping[str, Study] = MappingProxyType(
    {
        one.name: one
        for one in (
            reproduction.study(),
            comparison.study(7, "comparison"),
            comparison.study(8, "comparison_8r"),
            existence.study(),
            bounds.study(),
            failures.study(),
            figures.study(),
            robots.study(),
            benchmark.study(),
        )
    }
)


def chosen(only: Sequence[str] | None, long: bool) -> tuple[Study, ...]:
    """Return the studies to be run.

    Parameters
    ----------
    only
        Names; None for all that take under ten minutes.
    long
        Whether to run the others as well, where no names are given.

    Raises
    ------
    InputError
        If there is no study of a name.
    """
    for name in only or ():
        if name not in STUDIES:
            raise InputError("study", name, "one of " + ", ".join(STUDIES))
    if only is None:
        return tuple(one for one in STUDIES.values() if long or not one.long)
    return tuple(one for one in STUDIES.values() if one.name in only)
