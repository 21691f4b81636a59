"""The command line ``lockedjoint``: names the commands; each is a file in `commands`."""

from __future__ import annotations

from typing import Annotated

import typer

from formulations.commands.assess import assess
from formulations.commands.benchmark import benchmark
from formulations.commands.bound import bound
from formulations.commands.campaign import campaign
from formulations.commands.compare import compare
from formulations.commands.failures import failures
from formulations.commands.figure import figure
from formulations.commands.join import join
from formulations.commands.measure import measure
from formulations.commands.posture import posture
from formulations.commands.prove import prove
from formulations.commands.realise import realise
from formulations.commands.report import report
from formulations.commands.reproduce import reproduce
from formulations.commands.robots import robots
from formulations.commands.show import show
from formulations.commands.solve import solve
from formulations.commands.verify import verify

app = typer.Typer(
    name="lockedjoint",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
)
for command in (
    compare,
    reproduce,
    solve,
    measure,
    realise,
    assess,
    posture,
    robots,
    bound,
    prove,
    verify,
    campaign,
    join,
    show,
    figure,
    benchmark,
    failures,
    report,
):
    app.command()(command)


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
