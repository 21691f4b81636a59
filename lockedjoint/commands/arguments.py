"""Options that commands share, each written once, and what makes a function a command.

Options that belong together are the fields of a frozen dataclass. A command has one parameter
of that class, and `register` makes it the options of the command line.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from lockedjoint.commands.output import Answer
from lockedjoint.formulations.io.files import real_in, whole_in
from lockedjoint.nlp.errors import LARGEST, InputError, SolverOptionError, shown

if TYPE_CHECKING:
    from lockedjoint.figures.style import Look
    from lockedjoint.formulations.measures.unequal_failures import FailureModel

T = TypeVar("T")
Command = TypeVar("Command", bound=Callable[..., Answer | None])

# More random starts of one problem than a year of processor time makes.
MOST_STARTS = 10**9
# More joints and task dimensions than any statement or bound is computed for.
MOST_JOINTS = 1000
_MOST_DIMENSIONS = 100


def register(app: typer.Typer) -> Callable[[Command], Command]:
    """Return the decorator that makes a function a command, which shows what it returns.

    Parameters that are dataclasses become options, one a field; ``--json`` is added unless the
    function has it and returns nothing.
    """

    def registered(command: Command) -> Command:
        app.command(command.__name__.replace("_", "-"))(_with_options(command))
        return command

    return registered


def _with_options(command: Callable[..., Answer | None]) -> Callable[..., None]:
    groups: dict[str, Any] = {}
    options: dict[str, inspect.Parameter] = {}
    for name, given in inspect.signature(command, eval_str=True).parameters.items():
        if is_dataclass(given.annotation):
            groups[name] = given.annotation
            options |= inspect.signature(groups[name], eval_str=True).parameters
        else:
            options[name] = given
    keyword: Any = inspect.Parameter.KEYWORD_ONLY
    shows_itself = "as_json" in options
    if not shows_itself:
        options["as_json"] = inspect.Parameter(
            "as_json", keyword, default=False, annotation=Json
        )

    def run(**values: Any) -> None:
        for name, kind in groups.items():
            own = {field.name: values.pop(field.name) for field in fields(kind)}
            values[name] = kind(**own)
        as_json = not shows_itself and values.pop("as_json")
        answer = command(**values)
        if answer is not None:
            answer.show(as_json)

    parameters = [given.replace(kind=keyword) for given in options.values()]
    run.__name__, run.__doc__ = command.__name__, command.__doc__
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def option(
    metavar: str | None,
    words: str,
    default: Any = None,
    *names: str,
    low: int | None = None,
    high: int = LARGEST,
    positive: bool = False,
) -> Any:
    """Return an option: the default of a parameter or of a field, or within `Annotated`.

    The default is ``...`` where a value must be given, and within `Annotated`. A whole number
    has a range, from `low` to `high`; a positive one is finite, too. Without a `metavar` the
    help shows the choices.
    """
    parser = None
    if positive:
        parser = _number(real_in, lambda x: 0 < x < float("inf"), "a finite number above 0")
    elif low is not None:
        allowed = f"a whole number from {low} to {high if high < LARGEST else '2^63 - 1'}"
        parser = _number(whole_in, lambda x: low <= x <= high, allowed)
    return typer.Option(default, *names, metavar=metavar, help=words, parser=parser)


def argument(metavar: str, words: str) -> Any:
    """Return what is given without the name of an option, within `Annotated`."""
    return typer.Argument(metavar=metavar, help=words)


def flag(name: str, words: str) -> Any:
    """Return an option that is given or not."""
    return typer.Option(False, name, help=words)


def _number(
    read: Callable[[str], float], fits: Callable[[float], bool], allowed: str
) -> Callable[[str], float]:
    """Return a parser of numbers that fit."""

    def number(text: str) -> float:
        with suppress(ValueError):
            if fits(value := read(str(text))):
                return value
        raise typer.BadParameter(f"{shown(text)} given; allowed: {allowed}.")

    return number


Joints = Annotated[
    int, option("N", "Number of joints n, above m.", ..., low=2, high=MOST_JOINTS)
]
TaskDimension = Annotated[
    int, option("M", "Number of task dimensions m.", ..., low=1, high=_MOST_DIMENSIONS)
]
Starts = Annotated[
    int, option("K", "Random starts of each problem.", ..., low=1, high=MOST_STARTS)
]
Seed = Annotated[int, option("S", "Random seed; reproducible across machines.", ..., low=0)]
Workers = Annotated[
    int | None, option("W", "Worker processes; by default one per core.", ..., low=1)
]
Scheduler = Annotated[
    str | None,
    option(
        "ADDRESS",
        "Run on the Dask cluster with this scheduler, such as tcp://host:8786, instead.",
        ...,
    ),
]
Locked = Annotated[int, option("K", "How many joints lock at once.", ..., low=1)]
Pick = Annotated[
    int | None,
    option("K", "Which Jacobian of a file that has several, counted from 0.", ..., low=0),
]
Out = Annotated[Path, option("DIR", "Folder for the files; made if missing.", ...)]
JsonFile = Annotated[
    Path | None, option("FILE", "Write the JSON there, Jacobian included.", ..., "--out")
]
JacobianFile = Annotated[Path, argument("FILE", "CSV, NPY, NPZ or JSON; one column per joint.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
Ipopt = Annotated[
    list[str] | None,
    option(
        "NAME=VALUE",
        "An Ipopt option, such as max_iter=500, over the formulation's own. May be repeated.",
        ...,
    ),
]
Goal = Annotated[
    Literal["worst", "expected"],
    option(
        None,
        "What max-min maximises where failures have unequal probabilities. worst: the least of"
        " σ·(largest probability)/(probability) over the failures. expected: the mean of σ,"
        " weighted with the probabilities.",
        ...,
    ),
]


@dataclass(frozen=True)
class FigureOptions:
    """How a figure looks."""

    size: str | None = option(
        "WxH", "Width and height of the figure in cm, such as 16x10; in inches 6.3x4in."
    )
    no_title: bool = flag("--no-title", "Leave out the title of the whole figure.")
    style: Path | None = option("FILE", "A matplotlib style file, over this project's style.")

    def look(self) -> Look:
        """Return it read; InputError if the size or the style file is not allowed."""
        from lockedjoint.figures.style import read_look

        return read_look(self.size, not self.no_title, self.style, "--")


@dataclass(frozen=True)
class FailureOptions:
    """Which joints fail, how many at once and how likely."""

    locked: Locked = 1
    failure_probabilities: str | None = option(
        "P,…", "Each joint's probability of failure, 0 for never; or one number for all."
    )
    never_fails: str | None = option(
        "JOINT,…", "Joints that never fail, counted from 0; those of a robot also by name."
    )

    @property
    def probabilities_known(self) -> bool:
        """Whether probabilities were given."""
        return self.failure_probabilities is not None

    def model(self, names: Sequence[str]) -> FailureModel | None:
        """Return the failure model of joints of these names, or ""; None without an option."""
        if self.failure_probabilities is None and self.never_fails is None:
            return None
        from lockedjoint.formulations.measures.unequal_failures import FailureModel

        known = {name: str(k) for k, name in enumerate(names) if name}
        given = self.never_fails
        parts = [] if given is None else separated(given, list(known), ("", ","))
        numbers = (known.get(part) or known.get(part.strip(), part) for part in parts)
        try:
            spared = [whole_in(number) for number in numbers]
        except ValueError:
            allowed = "joints counted from 0, separated by commas"
            raise InputError("joints that never fail", given, allowed) from None
        if self.failure_probabilities is None:
            return FailureModel.equally_likely(len(names), self.locked, spared)
        values = by_joint(self.failure_probabilities, "failure probabilities", len(names))
        return FailureModel(tuple(values)).sparing(spared, self.locked)


def by_joint(text: str, name: str, joints: int) -> list[float]:
    """Read a number for each joint, or one for all; InputError if they are something else."""
    values = listed(text, real_in, name, "numbers separated by commas")
    values = values * joints if len(values) == 1 else values
    if len(values) != joints:
        raise InputError(name, text, f"{joints} numbers, one for each joint, or one for all")
    return values


def listed(text: str | None, kind: Callable[[str], T], name: str, allowed: str) -> list[T]:
    """Return what is between commas, read by `kind`; InputError if that raises ValueError."""
    try:
        return [kind(part) for part in text.split(",")] if text is not None else []
    except ValueError:
        raise InputError(name, text, allowed) from None


def separated(text: str, names: Sequence[str], after: Sequence[str] = ("=",)) -> list[str]:
    """Return the parts between commas, of which names at their beginning may have some, too.

    A name counts if one of some characters is after it, or nothing, if "" is one of these.
    """
    parts, rest, comma = [], text, ","
    while comma:
        begun = [
            name
            for name in names
            if rest.startswith(name) and rest[len(name) :].lstrip()[:1] in after
        ]
        own = max(map(len, begun), default=0)
        value, comma, following = rest[own:].partition(",")
        parts.append(rest[:own] + value)
        rest = following
    return parts


def assigned(
    settings: Sequence[str] | None,
    name: str,
    allowed: str,
    refusal: type[InputError] = InputError,
) -> list[tuple[str, str]]:
    """Return the two sides of settings like ``NAME=VALUE``; InputError if one is none."""
    pairs = []
    for setting in settings or ():
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not (key and equals):
            raise refusal(name, setting, allowed)
        pairs.append((key, value))
    return pairs


def ipopt_options(settings: Sequence[str] | None) -> dict[str, object]:
    """Read ``NAME=VALUE`` settings; numbers become numbers."""
    pairs = assigned(settings, "--ipopt", "NAME=VALUE, such as max_iter=500", SolverOptionError)
    return {name: _typed(value) for name, value in pairs}


def _typed(text: str) -> str | int | float:
    for kind in (whole_in, real_in):
        with suppress(ValueError):
            return kind(text)
    return text
