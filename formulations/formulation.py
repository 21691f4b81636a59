"""What every formulation offers; nothing else asks for a formulation's name."""

from collections.abc import Callable, Mapping
from typing import Protocol

from formulations.bounds.certified import Bound
from nlp.errors import InputError
from nlp.problem import Problem, Sense


class Formulation(Protocol):
    """A statement of the problem: a module, or any object, with these names.

    Attributes
    ----------
    NAME
        Its name on the command line, in tables and in stores.
    SENSE
        Whether it minimises or maximises its score.
    SETTINGS
        What can be set of it besides the arm, by name, and the defaults; passed to `build` and
        `score` by name. ``locked``, where it is among them, is the number of joints that lock
        at once.
    build
        ``build(arm, **settings)`` states the problem, with the options that suit it, and the
        output ``jacobian``. The first variables are those of the arm.
    score
        ``score(jacobian, **settings)`` is what the statement optimises, from J alone; not
        finite if J does not satisfy it.
    bound
        ``bound(arm, locked=1, certified=True)`` is the best bound on the score of any Jacobian
        of the arm, None if none is known: what is proved if `certified`, otherwise what is
        checked in floating point only.

    A formulation may also have ``check(arm, **settings)``, which refuses settings and returns
    them completed; ``sampler(arm, **settings)``, which returns what draws starts in place of
    ``arm.sample``; and ``compute_bound(arm, locked, rigorous, **options)``, which computes a
    bound now, by a proof if `rigorous`.
    """

    NAME: str
    SENSE: Sense
    SETTINGS: Mapping[str, object]

    @property
    def build(self) -> Callable[..., Problem]:
        """What states the problem."""

    @property
    def score(self) -> Callable[..., float]:
        """What judges a Jacobian."""

    @property
    def bound(self) -> Callable[..., Bound | None]:
        """What bounds the score."""


_PARTS = ("NAME", "SENSE", "SETTINGS", "build", "score", "bound")


def check_formulation(statement: object) -> None:
    """Raise InputError if something that `Formulation` names is missing."""
    missing = [part for part in _PARTS if not hasattr(statement, part)]
    if missing:
        allowed = f"an object with all of {', '.join(_PARTS)}"
        raise InputError("formulation", f"without {', '.join(missing)}", allowed)
