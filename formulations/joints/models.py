"""Kinds of joints by name, and arms of them: where a new kind is listed.

Names are for the command line, campaign files and tables. A user's own kind is known after
`register_joint`, or by the entry points ``lockedjoint.joints`` of an installed package.
"""

import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from importlib.metadata import entry_points
from itertools import groupby

from lockedjoint.formulations.io.files import real_in
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import (
    MOST_JOINTS,
    MOST_VARIABLES,
    ArmModel,
    Joint,
)
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.nlp.arrays import whole_number
from lockedjoint.nlp.errors import InputError

#: Functions that make a joint of a task dimension m, by the name of its kind.
MODELS: dict[str, Callable[[int], Joint]] = {
    "unit-revolute": lambda _: UnitRevolute(),
    "lever-revolute": lambda _: LeverRevolute(),
    "lever-revolute-each": lambda _: LeverRevolute(budget="each"),
    "prismatic": lambda _: Prismatic(),
    # Thrusters with a ratio of drag to thrust as of small propellers, per length of an arm.
    "rotor": lambda _: LeverRevolute(budget="each", pitch=0.05),
    "counter-rotor": lambda _: LeverRevolute(budget="each", pitch=-0.05),
    "free": lambda dimension: FreeColumn(dimension),
    "free-mean": lambda dimension: FreeColumn(dimension, budget="mean"),
}
_OURS = frozenset(MODELS)


def register_joint(name: str, joint: Joint | Callable[[int], Joint]) -> None:
    """List a kind of joint under a name, for this process.

    Parameters
    ----------
    name
        Its name: letters, digits and hyphens.
    joint
        A joint of this kind, or what makes one of a task dimension. Its numbers can be given in
        brackets behind the name.

    Raises
    ------
    InputError
        If the name is not allowed or taken, or it is no joint.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.register_joint("short-revolute", lambda dimension: lj.LeverRevolute(length=0.1))
    >>> lj.arm("short-revolute", joints=7).shape
    (6, 7)
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][\w-]*", name):
        raise InputError("name of a joint", name, "letters, digits and hyphens")
    if name in _OURS:
        raise InputError("name of a joint", name, "a name that no kind of the library has")
    if isinstance(joint, Joint):
        MODELS[name] = lambda _: joint
    elif callable(joint):
        MODELS[name] = joint
    else:
        raise InputError("joint", repr(joint), "a Joint, or what makes one")


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

    Examples
    --------
    >>> import lockedjoint as lj
    >>> arm = lj.arm("unit-revolute:5,prismatic:2")
    >>> arm.shape
    (6, 7)
    >>> arm
    <Arm: 5 × UnitRevolute(), 2 × Prismatic(speed=1.0), m = 6>
    """
    whole_number("task dimension", task_dimension, 1)
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


# Largest number of characters of a model's name.
_LONGEST = 1000
# Largest number of digits of a count in a name.
_MOST_DIGITS = 9
# The commas between the parts of a model, not those in brackets.
_BETWEEN = re.compile(r",(?![^(]*\))")


def _part(text: str, joints: int | None, task_dimension: int) -> tuple[Joint, int]:
    """Return the joint and the count of a part ``NAME(setting=NUMBER,…):COUNT`` of a model.

    Without a count it is `joints`.
    """
    stem, colon, count = text.partition(":")
    name, bracket, given = stem.partition("(")
    if bracket and not given.endswith(")"):
        raise InputError("model", text, "NAME(length=NUMBER), with both brackets")
    joint = _kind(name)(task_dimension)
    if joint.dimension != task_dimension:
        allowed = f"{joint.dimension} for the model {name}"
        raise InputError("task dimension", task_dimension, allowed)
    taken = _numbers(joint)
    words = " or ".join(f"{setting}=NUMBER" for setting in taken) or "nothing"
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
    digits = count.isascii() and count.isdigit() and len(count) <= _MOST_DIGITS
    if not (digits and int(count) > 0):
        raise InputError("model", text, "NAME:COUNT with a count of at least 1")
    return joint, whole_number("joints", int(count), 1, MOST_JOINTS)


def _name_of(joint: Joint) -> str:
    """Return the name that makes a joint, numbers that are unlike its own in brackets."""
    for name, make in MODELS.items():
        plain = make(joint.dimension)
        if type(plain) is not type(joint) or plain.dimension != joint.dimension:
            continue
        numbers = {setting: getattr(joint, setting) for setting in _numbers(plain)}
        if plain == joint or (numbers and replace(plain, **numbers) == joint):  # type: ignore[type-var]
            unlike = {k: v for k, v in numbers.items() if v != getattr(plain, k)}
            inside = ",".join(f"{key}={value!r}" for key, value in unlike.items())
            return f"{name}({inside})" if inside else name
    kinds = ", ".join(MODELS)
    raise InputError("joint", repr(joint), f"one of the kinds {kinds}")


def _numbers(joint: Joint) -> list[str]:
    """Return the settings of a kind that can be given in brackets: its numbers."""
    if not is_dataclass(joint):
        return []
    names = [field.name for field in fields(joint)]
    return [name for name in names if isinstance(getattr(joint, name), float)]


def _kind(name: str) -> Callable[[int], Joint]:
    """Return what makes a joint of a kind; looks for those of installed packages, too."""
    if name not in MODELS:
        for entry in entry_points(group="lockedjoint.joints"):
            register_joint(entry.name, entry.load())
    if name not in MODELS:
        raise InputError("model", name, "one of " + ", ".join(MODELS))
    return MODELS[name]


def is_unit_revolute(arm: ArmModel) -> bool:
    """Whether all joints are unit revolute ones to be designed."""
    return isinstance(arm, Arm) and set(arm.joints) == {UnitRevolute()}


def models_of(task_dimension: int) -> tuple[str, str]:
    """Return the two models compared by default: columns bounded each, and on the mean."""
    if task_dimension == 6:
        return "unit-revolute", "lever-revolute"
    return "free", "free-mean"
