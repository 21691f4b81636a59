"""The command line ``lockedjoint``: names the commands; each is a file in `commands`."""

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Annotated, Any

import typer

from nlp.interrupts import INTERRUPTED

# In the order in which the help lists them; each is the function of its name in its file.
COMMANDS = (
    "compare",
    "reproduce",
    "solve",
    "measure",
    "realise",
    "assess",
    "posture",
    "path",
    "workspace",
    "robots",
    "bound",
    "prove",
    "verify",
    "campaign",
    "join",
    "show",
    "figure",
    "benchmark",
    "failures",
    "report",
)
app = typer.Typer(
    name="lockedjoint",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
)


def _interruptible(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with a sentence after Ctrl-C; Typer would end without one."""

    @wraps(command)
    def run(*arguments: Any, **settings: Any) -> None:
        try:
            command(*arguments, **settings)
        except KeyboardInterrupt:
            typer.echo("Interrupted.", err=True)
            raise typer.Exit(INTERRUPTED) from None

    return run


for name in COMMANDS:
    module = import_module(f"formulations.commands.{name}")
    app.command()(_interruptible(getattr(module, name)))
app.add_typer(import_module("formulations.commands.atlas").app)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"lockedjoint {version('lockedjoint')}")
        raise typer.Exit


@app.callback()
def lockedjoint(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version."
        ),
    ] = False,
) -> None:
    """Design and certify optimally failure-tolerant manipulator Jacobians.

    Start with `lockedjoint compare`. Exit status: 0 when done, 1 when a check failed, 2 for
    input that is not allowed, 130 after Ctrl-C (what was done is kept).
    """
