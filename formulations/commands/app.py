"""The command line ``lockedjoint``: names the commands; each is a file in `commands`."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

# In the order in which the help lists them; each is the function of its name in its file.
COMMANDS = (
    "compare",
    "reproduce",
    "solve",
    "measure",
    "realise",
    "measure_robot",
    "posture",
    "path",
    "workspace",
    "view",
    "bound",
    "prove",
    "verify",
    "campaign",
    "join",
    "show",
    "figure",
    "atlas",
)
app = typer.Typer(
    name="lockedjoint",
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
)


for name in COMMANDS:
    module = import_module(f"formulations.commands.{name}")
    if hasattr(module, "app"):  # a command with commands of its own
        app.add_typer(module.app)
    else:
        app.command()(getattr(module, name))


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"lockedjoint {version('lockedjoint')}")
        raise typer.Exit


@app.callback()
def lockedjoint(
    version: Annotated[  # noqa: ARG001
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version."
        ),
    ] = False,
    plugin: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.py",
            help="A Python file with formulations or joints of your own, which all commands "
            "then know by name. May be repeated.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Design and certify optimally failure-tolerant manipulator Jacobians.

    Start with `lockedjoint compare`. Exit status: 0 when done, 1 when a check failed, 2 for
    input that is not allowed, 130 after Ctrl-C (what was done is kept).
    """
    for path in plugin or ():
        from formulations.registry import load_plugin

        load_plugin(path)
