"""Commands from functions: options are parameters, and the fields of dataclasses.

`command` makes a `click.Command` of a function that returns an `Answer`:

* a parameter without a default is an argument, with its position on the command line; one with
  a default is an option, or an argument if `ARGUMENT` marks it;
* a parameter whose type is a dataclass has an option for each of its fields, or for those that
  `Only` names; the function gets the dataclass, made of what the user gave. `FieldsOf` gives it
  a dict of these instead;
* `as_json` says that the function prints by itself; it is ``--json``.

What an option means is what the docstring says of the parameter or field, after what the
`vocabulary` says of its name; its default is theirs. Only what is given is passed on, so that
every default is stated once, in the library.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin

import click

from lockedjoint.commands.examples import examples
from lockedjoint.commands.output import Answer
from lockedjoint.commands.vocabulary import OF_JOINTS, WORDS, Word, names, numbers
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.nlp.errors import InputError

# Defaults that help does not show: nothing is given, or the docstring says what happens then.
_UNSAID: tuple[Any, ...] = (None, False, "", (), {}, 0.0)
# Options of a group that hold for all of its commands.
OF_ALL_COMMANDS = ("entries",)
# Help of the option --json.
_JSON = "Print JSON instead of text."
# Heads of the sections of a docstring in NumPy's style, such as "Parameters".
_SECTIONS = re.compile(r"^(\w[\w ]+)\n-+\n", re.MULTILINE)


@dataclass(frozen=True)
class Only:
    """Which fields of a dataclass are options of a command, in ``Annotated[Kind, Only(…)]``."""

    names: Collection[str]


@dataclass(frozen=True)
class FieldsOf:
    """Which fields of a dataclass become a dict, in ``Annotated[dict[str, Any], FieldsOf(…)]``.

    Each field is an option. The command gets those that the user gave, by name, and makes the
    dataclass itself.
    """

    kind: type
    names: Collection[str]


class _Argument:
    """Marks a parameter with a default that is given without the name of an option."""


#: The mark, in ``Annotated[Kind, ARGUMENT]``.
ARGUMENT = _Argument()


@dataclass(frozen=True)
class _Given:
    """A parameter of a function, or a field of a dataclass."""

    name: str
    said: str  #: What its docstring says of it.
    default: Any  #: Its default; ``...`` if it has none.
    many: bool = False  #: Whether it is a list.
    named: bool = True  #: Whether it is an option, whose name stands before it.


def command(function: Callable[..., Answer | None], **settings: Any) -> click.Command:
    """Return the command that calls a function and shows what it returns.

    `settings` are those of `click.Command`, such as the end of its help.
    """
    # For each parameter that is a dataclass: what makes its value, and the names of the
    # options.
    groups: dict[str, tuple[Callable[..., Any], Collection[str]]] = {}
    parameters: list[click.Parameter] = []
    said, shows_itself = described(function.__doc__ or ""), False
    for name, parameter in inspect.signature(function).parameters.items():
        if name == "as_json":  # the function shows what it finds by itself
            shows_itself = True
            continue
        annotation, marks = _with_marks(_evaluated(parameter.annotation, function))
        kind = next((mark.kind for mark in marks if isinstance(mark, FieldsOf)), annotation)
        if is_dataclass(kind):
            only = next(
                (mark.names for mark in marks if isinstance(mark, Only | FieldsOf)), None
            )
            chosen = [one for one in _fields_of(kind) if only is None or one.name in only]
            groups[name] = annotation, [one.name for one in chosen]
            parameters += map(_parameter, chosen)
        else:
            many = "list" in str(parameter.annotation)
            default = ... if parameter.default is parameter.empty else parameter.default
            named = default is not ... and ARGUMENT not in marks
            given = _Given(name, said.get(name, ""), default, many, named)
            parameters.append(_parameter(given))
    parameters += _unit_of_angles(parameters)
    parameters.append(click.Option(["--json", "as_json"], is_flag=True, help=_JSON))

    def run(as_json: bool, angles: str | None = None, **values: Any) -> None:
        chosen: dict[str, Any] = {k: v for k, v in values.items() if _is_given(v)}
        if as_json and not shows_itself:
            refuse_columns(chosen.get("columns"))
        if angles == "deg":
            chosen |= {k: InDegrees(v) for k, v in chosen.items() if k in OF_JOINTS}
        for name, (make, own_fields) in groups.items():
            own = {each: chosen.pop(each) for each in own_fields if each in chosen}
            chosen[name] = make(**own)
        more = {"as_json": as_json} if shows_itself else {}
        answer = function(**chosen, **more)
        if answer is not None:
            answer.show(as_json)

    title = function.__name__.replace("_", "-")
    text = description(function.__doc__ or "")
    return click.Command(title, params=parameters, callback=run, help=text, **settings)


def refuse_columns(columns: Sequence[str] | None) -> None:
    """Raise InputError if columns are given to a command whose JSON has all of them."""
    if columns is not None:
        allowed = "none with --json, which has all columns"
        raise InputError("--columns", ",".join(columns), allowed)


def _unit_of_angles(parameters: Collection[click.Parameter]) -> list[click.Parameter]:
    """Return the option that states the unit of angles, if a command takes some."""
    own = {parameter.name for parameter in parameters}
    if not own & {*OF_JOINTS, *(name for name, word in WORDS.items() if word.in_degrees)}:
        return []
    word = WORDS["angles"]
    kind, said = _Reads(word), word.says
    # The readers of other options have to know the unit of angles.
    return [
        click.Option(["--angles"], type=kind, metavar=word.metavar, help=said, is_eager=True)
    ]


def described(docstring: str) -> Mapping[str, str]:
    """Return what a docstring in NumPy's style says of each parameter, a line each."""
    lines = _section(inspect.cleandoc(docstring), "Parameters").splitlines()
    said: dict[str, list[str]] = {}
    for line in lines:
        if line and not line.startswith(" "):
            current: list[str] = []
            said |= dict.fromkeys((name.strip() for name in line.split(",")), current)
        elif line:
            current.append(line.strip())
    return {name: " ".join(words) for name, words in said.items()}


def description(docstring: str) -> str:
    """Return a docstring without its sections of parameters and the like, for help."""
    text = inspect.cleandoc(docstring)
    begin = _SECTIONS.search(text)
    return text[: begin.start()].strip() if begin else text


def _section(text: str, title: str) -> str:
    """Return the content of a section of a docstring; empty if there is none."""
    begins = list(_SECTIONS.finditer(text))
    ends = [*(match.start() for match in begins[1:]), len(text)]
    for match, end in zip(begins, ends, strict=False):
        if match[1] == title:
            return text[match.end() : end]
    return ""


def _evaluated(annotation: Any, function: Callable[..., Any]) -> Any:
    """Return what an annotation stands for; itself if only type checkers import that."""
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, function.__globals__)
    except NameError:
        return annotation


def _with_marks(annotation: Any) -> tuple[Any, list[Any]]:
    """Return a type, and what `Annotated` adds to it."""
    if get_origin(annotation) is not Annotated:
        return annotation, []
    kind, *marks = get_args(annotation)
    return kind, marks


def _fields_of(kind: Any) -> list[_Given]:
    """Return the fields of a dataclass that are words of the vocabulary."""
    said = described(kind.__doc__ or "")
    given = []
    for field in fields(kind):
        if not field.init or field.name not in WORDS:
            continue
        default = field.default
        if default is MISSING:
            default = ... if field.default_factory is MISSING else field.default_factory()
        many = "list" in str(field.type)
        said_of = said.get(field.name, "")
        given.append(_Given(field.name, said_of, default, many, default is not ...))
    return given


class _Reads(click.ParamType[Any]):
    """The type of a parameter for click: the reader of a `Word`."""

    def __init__(self, word: Word) -> None:
        self.word = word
        self.name = word.metavar or "text"

    def convert(
        self,
        value: Any,
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        """Read a text; InputError if it is not allowed."""
        if not isinstance(value, str):
            return value
        name = param.opts[0] if isinstance(param, click.Option) else self.name
        degrees = ctx is not None and ctx.params.get("angles") == "deg"
        read = self.word.in_degrees if degrees and self.word.in_degrees else self.word.read
        return read(name, value)


def _parameter(given: _Given) -> click.Parameter:
    """Return an argument where something must be given, else an option."""
    word = WORDS[given.name]
    said = _together(word.says, given.said)
    many = word.many or (given.many and word.read not in (names, numbers))
    read = _gathering(word) if many else None
    metavar = word.metavar
    if not given.named:
        shown = f"{metavar}..." if many else metavar
        required = given.default is ...
        count = -1 if many else 1
        return click.Argument(
            [given.name],
            type=_Reads(word),
            metavar=shown if required else f"[{shown}]",
            nargs=count,
            required=required,
            callback=read,
            help=said,
        )
    name = f"--{given.name.replace('_', '-')}"
    if not metavar:
        return click.Option([name, given.name], is_flag=True, help=said)
    unsaid = any(given.default is one or given.default == one for one in _UNSAID)
    return click.Option(
        [name, given.name],
        type=_Reads(word),
        metavar=metavar,
        multiple=many,
        help=said if unsaid else f"{said}  [default: {given.default}]",
        callback=read,
        default=None,
    )


def _together(general: str, particular: str) -> str:
    """Return what an option means in every command and in this one, without saying it twice.

    If the second text begins as the first, up to its first semicolon, the longer one stands.
    """
    first = general.partition(";")[0].rstrip(".:")
    if first and particular.startswith(first):
        return max(general, particular, key=len)
    return f"{general} {particular}".strip()


def _gathering(word: Word) -> Callable[[click.Context, click.Parameter, Any], Any]:
    """Return click's callback that makes one value of all that an option was given."""

    def gather(_: click.Context, parameter: click.Parameter, values: Any) -> Any:
        name = parameter.opts[0]
        return word.gather(name, list(values)) if values else None

    return gather


def _is_given(value: Any) -> bool:
    """Whether the user gave an option: click has None, or False for a flag, if not."""
    return value is not None and value is not False


def group(
    name: str, alone: Callable[..., Answer | None], *functions: Callable[..., Answer | None]
) -> click.Group:
    """Return a group of commands.

    `alone` is what it does without a command, and `functions` are its commands. Options before
    a command's name are those of `alone`: they are refused, but for `OF_ALL_COMMANDS`.
    """
    own = command(alone)

    def run(**values: Any) -> None:
        context = click.get_current_context()
        if context.invoked_subcommand is None:
            assert own.callback is not None
            own.callback(**values)
            return
        for option, value in values.items():
            if _is_given(value) and option not in OF_ALL_COMMANDS:
                shown = f"--{option.removeprefix('as_').replace('_', '-')}"
                raise InputError(shown, value, f"after `{context.invoked_subcommand}`")
        context.obj = {each: values.get(each) for each in OF_ALL_COMMANDS}

    made = click.Group(
        name,
        params=own.params,
        callback=run,
        invoke_without_command=True,
        help=own.help,
        epilog=examples(name),
    )
    for function in functions:
        title = function.__name__.replace("_", "-")
        made.add_command(command(function, epilog=examples(f"{name} {title}")))
    return made


def of_group(name: str) -> Any:
    """Return the value of an option of `OF_ALL_COMMANDS` that the command's group was given."""
    found = click.get_current_context().find_object(dict)
    return (found or {}).get(name)
