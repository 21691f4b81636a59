"""The figures by name, with what each is made from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from formulations.plot import (
    figure_1,
    figure_3,
    optima,
    seven_axes,
    singular_values,
    trade_off,
)
from formulations.plot.picture import Picture, Request
from nlp.errors import InputError


@dataclass(frozen=True)
class Kind:
    """A kind of figure.

    Attributes
    ----------
    make
        Computes the numbers and draws them.
    starts
        Default number of random starts of each problem.
    takes
        What may be shown instead: ``jacobian``, ``store``.
    """

    make: Callable[[Request], Picture]
    starts: int
    takes: frozenset[str] = frozenset()


FIGURES: Mapping[str, Kind] = MappingProxyType(
    {
        "figure-1": Kind(figure_1.make, 5),
        "figure-3": Kind(figure_3.make, 100),
        "seven-axes": Kind(seven_axes.make, 5, frozenset({"jacobian"})),
        "singular-values": Kind(singular_values.make, 5, frozenset({"jacobian"})),
        "trade-off": Kind(trade_off.make, 5),
        "optima": Kind(optima.make, 50, frozenset({"store"})),
    }
)


def kind(name: str) -> Kind:
    """Return a kind of figure by name; InputError if there is none."""
    if name not in FIGURES:
        raise InputError("figure", name, "one of " + ", ".join(FIGURES))
    return FIGURES[name]
