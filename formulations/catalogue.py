"""The formulations and column models by name: where a new one is listed."""

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from itertools import groupby
from types import MappingProxyType
from typing import Protocol, TypeVar

from formulations import isotropy, manipulability, max_min, residual
from formulations.bounds.certified import Bound
from formulations.joints.arm import Arm
from formulations.joints.joint import MOST_JOINTS, MOST_VARIABLES, ColumnModel, Joint
from formulations.joints.kinds import FreeColumn, LeverRevolute, Prismatic, UnitRevolute
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError
from nlp.files import real_in
from nlp.options import OptionValue
from nlp.problem import Problem, Sense

_T = TypeVar("_T")


class Formulation(Protocol):
    """What every formulation's module offers; nothing else asks for a formulation's name.

    Attributes
    ----------
    NAME
        Its name on the command line, in tables and in stores.
    SENSE
        Whether it minimises or maximises its merit.
    OPTIONS
        Ipopt's options that suit it.
    SETTINGS
        Names of the settings of a `formulations.solving.setup.Setup` that it takes.
    """

    NAME: str
    SENSE: Sense
    OPTIONS: Mapping[str, OptionValue]
    SETTINGS: frozenset[str]

    def build(self, arm: ColumnModel) -> Problem:
        """State the problem for an arm."""

    def merit(self, jacobian: FloatArray, locked: int = 1) -> float:
        """What the statement optimises, from J alone; not finite if J does not satisfy it."""

    def bound(self, arm: Arm, locked: int = 1, certified: bool = True) -> Bound | None:
        """Return the best bound on the merit of any Jacobian of the arm; None if none is known.

        `locked` joints lock at once. If `certified`, what is proved; otherwise what is checked
        in floating point only.
        """


FORMULATIONS: dict[str, Formulation] = {
    module.NAME: module for module in (residual, max_min, isotropy, manipulability)
}

MODELS: Mapping[str, Callable[[int], Joint]] = MappingProxyType(
    {
        "unit-revolute": lambda _: UnitRevolute(),
        "lever-revolute": lambda _: LeverRevolute(),
        "lever-revolute-each": lambda _: LeverRevolute(budget="each"),
        "prismatic": lambda _: Prismatic(),
        "free": lambda dimension: FreeColumn(dimension),
        "free-mean": lambda dimension: FreeColumn(dimension, budget="mean"),
    }
)


def register(statement: Formulation) -> None:
    """List a formulation under its name, for this process.

    Parameters
    ----------
    statement
        A module, or any object, with what the protocol `Formulation` names.

    Raises
    ------
    InputError
        If something that the protocol names is missing, or another formulation has the name.
    """
    parts = ("NAME", "SENSE", "OPTIONS", "SETTINGS", "build", "merit", "bound")
    missing = [part for part in parts if not hasattr(statement, part)]
    if missing:
        allowed = f"all of {', '.join(parts)}"
        raise InputError("formulation", f"without {', '.join(missing)}", allowed)
    if FORMULATIONS.get(statement.NAME, statement) is not statement:
        raise InputError("formulation", statement.NAME, "a name that no other formulation has")
    FORMULATIONS[statement.NAME] = statement


def formulation(name: str) -> Formulation:
    """Return a formulation by name; InputError if there is none."""
    return _named("formulation", name, FORMULATIONS)


def certified_bound(name: str, arm: Arm, locked: int = 1) -> Bound:
    """Return the best bound on a formulation's merit that is proved.

    Parameters
    ----------
    name
        Name of the formulation.
    arm
        The joints.
    locked
        How many joints lock at once.

    Raises
    ------
    InputError
        If there is no such formulation, or no bound of its own is proved.
    """
    found = formulation(name).bound(arm, locked)
    if found is None:
        known = [one.NAME for one in FORMULATIONS.values() if one.bound(arm, locked)]
        allowed = f"one with a proved bound of its own: {', '.join(known)}"
        raise InputError("formulation", name, allowed)
    return found


def numerical_bound(name: str, arm: Arm, locked: int = 1) -> Bound | None:
    """Return the best bound on record that is checked in floating point only, or None.

    Raises
    ------
    InputError
        If there is no such formulation.
    """
    return formulation(name).bound(arm, locked, certified=False)


def arm(model: str, joints: int | None = None, task_dimension: int = 6) -> Arm:
    """Return an arm by the name of its joints' column model.

    Parameters
    ----------
    model
        A name in `MODELS`; or a mix such as ``lever-revolute:6,prismatic:2``. A joint's length,
        speed or norm is given in brackets: ``lever-revolute(length=0.3):6``.
    joints
        Number of joints n, at most `MOST_JOINTS`; of a mix, the sum of its parts, which it is
        by default.
    task_dimension
        Number of task dimensions m.

    Raises
    ------
    InputError
        If there is no such model, it has another task dimension, joints are too few or too
        many, or they have more than `MOST_VARIABLES` variables.
    """
    if not isinstance(model, str) or len(model) > _LONGEST:
        raise InputError("model", model, "NAME or NAME(length=…):COUNT, separated by commas")
    parts = [_part(part, joints, task_dimension) for part in _BETWEEN.split(model)]
    count = sum(many for _, many in parts)
    if whole_number("joints", count if joints is None else joints, 1, MOST_JOINTS) != count:
        raise InputError("joints", joints, f"{count} for {model}")
    made = Arm(tuple(joint for joint, many in parts for _ in range(many)))
    if made.size > MOST_VARIABLES:
        given = f"{count} of {made.size} variables"
        raise InputError("joints", given, f"at most {MOST_VARIABLES} variables")
    return made


def model_of(arm: Arm) -> str:
    """Return the model's name of which `arm` makes this arm.

    Raises
    ------
    InputError
        If one of its joints is of a kind that `MODELS` does not list.
    """
    names = [_name_of(joint) for joint in arm.joints]
    runs = [(name, len(list(same))) for name, same in groupby(names)]
    if len(runs) == 1:
        return runs[0][0]
    return ",".join(f"{name}:{count}" for name, count in runs)


_LONGEST = 1000
# The commas between the parts of a model, not those in brackets.
_BETWEEN = re.compile(r",(?![^(]*\))")
# What can be given in brackets, of the kinds that have it.
_LENGTHS = ("length", "speed", "norm")


def _part(text: str, joints: int | None, task_dimension: int) -> tuple[Joint, int]:
    stem, colon, count = text.partition(":")
    name, bracket, given = stem.partition("(")
    if bracket and not given.endswith(")"):
        raise InputError("model", text, "NAME(length=NUMBER), with both brackets")
    joint = _named("model", name, MODELS)(task_dimension)
    if joint.dimension != task_dimension:
        allowed = f"{joint.dimension} for the model {name}"
        raise InputError("task dimension", task_dimension, allowed)
    taken = [one.name for one in fields(joint) if one.name in _LENGTHS]  # type: ignore[arg-type]
    words = " or ".join(f"{one}=NUMBER" for one in taken) or "nothing"
    for setting in given[:-1].split(",") if bracket else ():
        key, _, number = setting.partition("=")
        try:
            value = real_in(number)
        except ValueError:
            raise InputError("model", text, f"{words} in brackets") from None
        if key.strip() not in taken:
            raise InputError("model", text, f"{words} in brackets")
        joint = replace(joint, **{key.strip(): value})  # type: ignore[type-var]
    if not colon:
        if joints is None:
            raise InputError("joints", "missing", f"a number, or {text}:COUNT")
        return joint, whole_number("joints", joints, 1, MOST_JOINTS)
    if not (count.isascii() and count.isdigit() and len(count) < 10 and int(count) > 0):
        raise InputError("model", text, "NAME:COUNT with a count of at least 1")
    return joint, whole_number("joints", int(count), 1, MOST_JOINTS)


def _name_of(joint: Joint) -> str:
    for name, make in MODELS.items():
        plain = make(joint.dimension)
        if type(plain) is not type(joint) or plain.dimension != joint.dimension:
            continue
        lengths = {one: getattr(joint, one) for one in _LENGTHS if hasattr(plain, one)}
        if replace(plain, **lengths) == joint:  # type: ignore[type-var]
            unlike = {k: v for k, v in lengths.items() if v != getattr(plain, k)}
            inside = ",".join(f"{key}={value!r}" for key, value in unlike.items())
            return f"{name}({inside})" if inside else name
    kinds = ", ".join(MODELS)
    raise InputError("joint", repr(joint), f"one of the kinds {kinds}")


def models_of(task_dimension: int) -> tuple[str, str]:
    """Return the two models compared by default: columns bounded each, and on the mean."""
    if task_dimension == 6:
        return "unit-revolute", "lever-revolute"
    return "free", "free-mean"


def _named(kind: str, name: str, known: Mapping[str, _T]) -> _T:
    if name not in known:
        raise InputError(kind, name, "one of " + ", ".join(known))
    return known[name]
