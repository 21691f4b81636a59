"""What every formulation offers, the formulations by name, and bounds on their optima.

Names are for the command line, campaign files and tables; the library passes the objects. A
user's own is known after `register`, from a file of `load_plugin`, or by the entry points
``lockedjoint.formulations`` of an installed package. Joints:
`lockedjoint.formulations.joints.models`.
"""

import importlib.util
import inspect
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol

import cloudpickle

from lockedjoint.formulations import condition, isotropy, manipulability, max_min, residual
from lockedjoint.formulations.bounds.certified import Bound
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.nlp.arrays import whole_number
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.nlp.problem import Problem, Sense


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
        `score` by name. ``failures``, where it is among them, is the number of joints that lock
        at once.
    build
        ``build(arm, **settings)`` states the problem, with the options that suit it, and the
        output ``jacobian``. The first variables are those of the arm.
    score
        ``score(jacobian, **settings)`` is what the statement optimises, from J alone; not
        finite if J does not satisfy it.
    bound
        ``bound(arm, failures=1)`` is the best bound on the score of any Jacobian of the arm,
        None if none is known.

    A formulation may also have ``check(arm, **settings)``, which refuses settings and returns
    them completed, and ``sampler(arm, **settings)``, which returns what draws starts in place
    of ``arm.sample``. ``SCORE``, or else the first line of the docstring of ``score``, says
    below tables what its score is.
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


# The names of `Formulation`.
_PARTS = ("NAME", "SENSE", "SETTINGS", "build", "score", "bound")
# A new formulation of ours is listed here. Those of `compare` are listed in `comparison.cases`.
_OURS: tuple[Formulation, ...] = (residual, max_min, isotropy, manipulability, condition)
#: The formulations that are known in this process, by name.
FORMULATIONS: dict[str, Formulation] = {module.NAME: module for module in _OURS}


def meaning_of_score(statement: Formulation) -> str:
    """Return what the score of a formulation is, in a few words."""
    said = getattr(statement, "SCORE", None) or inspect.getdoc(statement.score)
    return str(said).splitlines()[0].rstrip(".") if said else f"what it {statement.SENSE}s"


def check_formulation(statement: object) -> None:
    """Raise InputError if something that `Formulation` names is missing."""
    missing = [part for part in _PARTS if not hasattr(statement, part)]
    if missing:
        allowed = f"an object with all of {', '.join(_PARTS)}"
        raise InputError("formulation", f"without {', '.join(missing)}", allowed)


def register(statement: Formulation) -> None:
    """List a formulation under its name, for this process.

    Parameters
    ----------
    statement
        A module, or any object, with what `Formulation` names.

    Raises
    ------
    InputError
        If something that it names is missing, or another formulation has the name.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> class Twice:  # the residual under another name
    ...     NAME, SENSE, SETTINGS = "residual-again", "minimise", {}
    ...     build = staticmethod(lj.residual.build)
    ...     score = staticmethod(lj.residual.score)
    ...     bound = staticmethod(lj.residual.bound)
    >>> lj.register(Twice)
    >>> "residual-again" in lj.FORMULATIONS
    True
    """
    check_formulation(statement)
    if FORMULATIONS.get(statement.NAME, statement) is not statement:
        raise InputError("formulation", statement.NAME, "a name that no other formulation has")
    FORMULATIONS[statement.NAME] = statement


def registered() -> tuple[Formulation, ...]:
    """Return the formulations that users registered in this process."""
    return tuple(own for own in FORMULATIONS.values() if own not in _OURS)


def load_plugin(path: Path) -> None:
    """Run a Python file that registers formulations or joints.

    A file that is a formulation itself is registered. Its functions are sent to worker
    processes by value, so it need not be installed there.

    Raises
    ------
    FileError
        If it cannot be run.
    """
    name = f"lockedjoint_plugin_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise FileError("plugin", str(path), "a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # classes defined there look themselves up by it
    cloudpickle.register_pickle_by_value(module)
    try:
        spec.loader.exec_module(module)
    except Exception as reason:
        said = f"a Python file that runs ({type(reason).__name__}: {reason})"
        raise FileError("plugin", str(path), said) from reason
    if hasattr(module, "NAME"):
        register(module)


def formulation_of(name: str | Formulation) -> Formulation:
    """Return a formulation by its name, or itself; InputError if there is none."""
    if not isinstance(name, str):
        check_formulation(name)
        return name
    if name not in FORMULATIONS:
        for entry in entry_points(group="lockedjoint.formulations"):
            register(entry.load())
    if name not in FORMULATIONS:
        raise InputError("formulation", name, "one of " + ", ".join(FORMULATIONS))
    return FORMULATIONS[name]


def bound(formulation: str | Formulation, arm: ArmModel, failures: int = 1) -> Bound:
    """Return the best bound known on a formulation's score of any Jacobian of an arm.

    Parameters
    ----------
    formulation
        The formulation.
    arm
        The joints.
    failures
        How many joints lock at once.

    Returns
    -------
    Bound
        The sharpest of what the relaxation proves, of closed forms, and of what is on record.
        `lockedjoint bound residual` and `max-min` prove what is on record anew, in minutes.

    Raises
    ------
    InputError
        If there is no such formulation, or no bound of its own is known.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.bound("max-min", lj.arm("unit-revolute", joints=7))
    <Bound: 0.57227615711298, proved (null-vector)>
    >>> limit = lj.bound("max-min", lj.arm("unit-revolute", joints=8), failures=2)
    >>> print(f"{limit.value:.6f}, {limit.kind}")
    0.230703, closed form
    """
    statement = formulation_of(formulation)
    if isinstance(arm, type) or not hasattr(arm, "matrix"):
        raise InputError(
            "arm", arm, "an Arm, such as arm('unit-revolute', 7, 6), or a RobotArm"
        )
    whole_number("failures", failures, 1)
    known = statement.bound(arm, failures)
    if known is None:
        others = ", ".join(
            other.NAME for other in FORMULATIONS.values() if other.bound(arm, failures)
        )
        allowed = f"one with a bound of its own: {others or 'none for this arm'}"
        raise InputError("formulation", statement.NAME, allowed)
    return known
