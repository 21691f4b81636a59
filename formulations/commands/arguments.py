"""Arguments that commands share, each checked with one sentence of our own."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from nlp.errors import LARGEST, InputError, SolverOptionError, shown
from nlp.files import real_in, whole_in

if TYPE_CHECKING:
    from formulations.measures.unequal_failures import FailureModel
    from formulations.plot.style import Look

T = TypeVar("T")


# More random starts of one problem than a year of processor time makes.
MOST_STARTS = 10**9
# More joints and task dimensions than any statement or bound is computed for.
MOST_JOINTS = 1000
MOST_DIMENSIONS = 100


def whole(lowest: int, highest: int = LARGEST) -> Callable[[str], int]:
    """Return a parser of whole numbers from `lowest` to `highest`."""

    def whole_number(text: str) -> int:
        number = None
        with suppress(ValueError):
            number = whole_in(str(text))
        if number is not None and lowest <= number <= highest:
            return number
        above = "" if number is not None and number < lowest else f" and at most {highest}"
        allowed = f"a whole number of at least {lowest}{above}"
        raise typer.BadParameter(f"{shown(text)} given; allowed: {allowed}.")

    return whole_number


def whole_option(
    lowest: int, metavar: str, words: str, highest: int = LARGEST, **settings: Any
) -> Any:
    """Return an option that takes whole numbers from `lowest` to `highest`."""
    parser = whole(lowest, highest)
    return typer.Option(parser=parser, metavar=metavar, help=words, **settings)


def refuse_unused(context: typer.Context, names: Iterable[str], reason: str) -> None:
    """Refuse options that were given though nothing would be done with them.

    Parameters
    ----------
    context
        Of the command.
    names
        The options, by the names of the command's parameters.
    reason
        With what they are not used, such as ``--quantity worst-case``.

    Raises
    ------
    InputError
        If one was given on the command line, also if its value is the default.
    """
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            value = context.params[name]
            given = "given" if value is True else str(value)
            raise InputError(f"--{name.replace('_', '-')}", given, f"none with {reason}")


def progress(sentence: str) -> None:
    """Show what is being done, on a terminal's standard error."""
    if sys.stderr.isatty():
        typer.echo(f"\r\x1b[K{sentence[:78]}", nl=False, err=True)


def positive(text: str) -> float:
    """Parse a finite number above 0."""
    number = float("nan")
    with suppress(ValueError):
        number = real_in(str(text))
    if not 0 < number < float("inf"):
        raise typer.BadParameter(f"{shown(text)} given; allowed: a finite number above 0.")
    return number


def positive_option(metavar: str, words: str, *names: str, **settings: Any) -> Any:
    """Return an option that takes finite numbers above 0."""
    return typer.Option(*names, parser=positive, metavar=metavar, help=words, **settings)


Joints = Annotated[int, whole_option(2, "N", "Number of joints n, above m.", MOST_JOINTS)]
TaskDimension = Annotated[
    int, whole_option(1, "M", "Number of task dimensions m.", MOST_DIMENSIONS)
]
Starts = Annotated[int, whole_option(1, "K", "Random starts of each row.", MOST_STARTS)]
Seed = Annotated[int, whole_option(0, "S", "Seed; start k of a seed is the same everywhere.")]
Workers = Annotated[
    int | None, whole_option(1, "W", "Worker processes.", show_default="all cores")
]
Locked = Annotated[int, whole_option(1, "K", "How many joints lock at once.")]
Tolerance = Annotated[
    float,
    positive_option("TOL", "Relative tolerance of the verdict 'optimally failure tolerant'."),
]
Out = Annotated[
    Path, typer.Option(metavar="DIR", help="Folder for the files; made if missing.")
]
Pick = Annotated[
    int | None, whole_option(0, "K", "Which Jacobian of the file, counted from 0.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
Size = Annotated[
    str | None,
    typer.Option(
        "--size",
        metavar="WxH",
        help="Width and height of the figure in cm, such as 16x10; in inches 6.3x4in.",
        show_default="the figure's own",
    ),
]
NoTitle = Annotated[
    bool, typer.Option("--no-title", help="Leave out the title of the whole figure.")
]
Style = Annotated[
    Path | None,
    typer.Option(
        "--style",
        metavar="FILE",
        help="A matplotlib style file, over this project's style.",
        show_default=False,
    ),
]
Ipopt = Annotated[
    list[str] | None,
    typer.Option(
        "--ipopt",
        metavar="NAME=VALUE",
        help="An Ipopt option, over the formulation's own; may be repeated.",
        show_default=False,
    ),
]

Compiled = Annotated[
    bool,
    typer.Option(
        "--compiled", help="Compile the problem's functions first, if there is a C compiler."
    ),
]

Probabilities = Annotated[
    str | None,
    typer.Option(
        "--failure-probabilities",
        metavar="P,…",
        help="Each joint's probability of failure, 0 for never; or one number for all.",
        show_default=False,
    ),
]
ProbabilitySets = Annotated[
    list[str] | None,
    typer.Option(
        "--failure-probabilities",
        metavar="P,…",
        help="Each joint's probability of failure, 0 for never; or one number for all. May be "
        "repeated: the least over these scenarios counts.",
        show_default=False,
    ),
]
Goal = Annotated[
    str,
    typer.Option(
        help="What max-min maximises where failures are unequal: worst, the least dexterity "
        "over each failure's relative probability, or expected."
    ),
]
NeverFails = Annotated[
    str | None,
    typer.Option(
        "--never-fails",
        metavar="JOINT,…",
        help="Joints that never fail, counted from 0.",
        show_default=False,
    ),
]


def look(size: str | None, no_title: bool, style: Path | None) -> Look:
    """Return how figures are to look.

    Raises
    ------
    InputError
        If the size or the style file is not allowed.
    """
    from formulations.plot.style import read_look

    return read_look(size, not no_title, style, "--")


def ipopt_options(settings: Sequence[str] | None) -> dict[str, object]:
    """Read ``NAME=VALUE`` settings; numbers become numbers.

    Raises
    ------
    SolverOptionError
        If a setting has no ``=``.
    """
    options: dict[str, object] = {}
    for setting in settings or ():
        name, equals, value = setting.partition("=")
        if not (name and equals):
            raise SolverOptionError("--ipopt", setting, "NAME=VALUE, such as max_iter=500")
        options[name.strip()] = _number(value.strip())
    return options


def _number(text: str) -> str | int | float:
    for kind in (whole_in, real_in):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def failure_model(
    probabilities: str | None, never_fails: str | None, joints: int, locked: int
) -> FailureModel | None:
    """Return the failure model that the two options describe; None if neither is given.

    Raises
    ------
    InputError
        If there is not one probability per joint, or a number is not allowed.
    """
    if probabilities is None and never_fails is None:
        return None
    from formulations.measures.unequal_failures import FailureModel

    words = "joints counted from 0, separated by commas"
    never = _numbers(never_fails, whole_in, "joints that never fail", words)
    if probabilities is None:
        return FailureModel.equally_likely(joints, locked, never)
    words = "numbers separated by commas"
    values = _numbers(probabilities, real_in, "failure probabilities", words)
    if len(values) == 1:
        values *= joints
    if len(values) != joints:
        allowed = f"{joints} numbers, one for each joint, or one for all"
        raise InputError("failure probabilities", probabilities, allowed)
    return FailureModel(tuple(values)).sparing(never, locked)


def failure_scenarios(
    probabilities: Sequence[str] | None,
    never_fails: str | None,
    names: Sequence[str],
    locked: int,
) -> tuple[FailureModel, ...] | None:
    """Return the failure models that the options of a robot describe; None if none is given.

    Parameters
    ----------
    probabilities
        Each joint's, as often as there are scenarios.
    never_fails
        Joints by name, or counted from 0.
    names
        Names of the joints.
    locked
        How many joints lock at once.

    Raises
    ------
    InputError
        As `failure_model` does.
    """
    if never_fails is not None:
        known = {name: str(k) for k, name in enumerate(names)}
        parts = (part.strip() for part in never_fails.split(","))
        never_fails = ",".join(known.get(part, part) for part in parts)
    given: Sequence[str | None] = probabilities or [None]
    models = [failure_model(one, never_fails, len(names), locked) for one in given]
    return tuple(one for one in models if one is not None) or None


def _numbers(text: str | None, kind: Callable[[str], T], name: str, allowed: str) -> list[T]:
    try:
        return [kind(part) for part in text.split(",")] if text is not None else []
    except ValueError:
        raise InputError(name, text, allowed) from None
