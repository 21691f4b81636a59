"""The studies by name, in the order in which they run: where a new one is listed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from formulations.report import (
    benchmark_study,
    bounds_study,
    comparison_study,
    existence_study,
    failures_study,
    figures_study,
    reproduction_study,
    robots_study,
)
from formulations.report.study import Study
from nlp.errors import InputError

STUDIES: Mapping[str, Study] = MappingProxyType(
    {
        one.name: one
        for one in (
            reproduction_study.study(),
            comparison_study.study(7, "comparison"),
            comparison_study.study(8, "comparison_8r"),
            existence_study.study(),
            bounds_study.study(),
            failures_study.study(),
            figures_study.study(),
            robots_study.study(),
            benchmark_study.study(),
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
