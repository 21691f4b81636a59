"""The command line ``lockedjoint``: its commands in groups, each with examples.

A command is a function in a module of this folder, which is imported when the command runs or
its help is asked for. So the help of all commands is fast, and says what `GROUPS` says. To add
a command, write its function in a module, an entry in `GROUPS`, and lines in `examples`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from lockedjoint import __version__

#: Headings of the help; under each the commands by name, in the order of the help: the module
#: of each in this folder, and a sentence that says what it does.
GROUPS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "Design": {
        "compare": ("results", "Compare the three formulations from common random starts."),
        "solve": (
            "solve",
            "Solve one formulation from random starts; measure the best answer.",
        ),
        "measure": ("measure", "Measure how failure tolerant a Jacobian or a robot is."),
        "realise": ("realise", "Realise a Jacobian as a manipulator."),
    },
    "Certify": {
        "bound": ("bound", "Bound how good any answer could be."),
        "prove": ("prove", "Prove that an optimal nR Jacobian exists, or that none does."),
        "verify": ("prove", "Verify a certificate, or a workspace that is kept."),
    },
    "Robots": {
        "posture": ("posture", "Find the most failure-tolerant posture of a robot."),
        "path": ("path", "Find the trajectory along which most joints may lock."),
        "recover": (
            "recover",
            "Reach a goal after joints have failed, or prove that none can.",
        ),
        "workspace": ("workspace", "Measure the workspace that is kept whatever joint fails."),
        "prove-workspace": ("workspace", "Prove that cubes of positions are kept."),
        "view": ("view", "Show a robot in a web page."),
        "codegen": ("codegen", "Write a C function of the worst case and its gradient."),
    },
    "Many starts": {
        "campaign": ("campaign", "Run a declared grid of problems from many random starts."),
        "show": ("campaign", "Show what a campaign's store holds."),
        "join": ("campaign", "Bring the records of other stores into one."),
        "atlas": ("atlas", "List the best Jacobians known, beside the sharpest bounds."),
    },
    "Results": {
        "reproduce": ("results", "Recompute every numbered example and claim of the paper."),
        "figure": ("results", "Draw a figure of results."),
    },
}
# Settings of click: help has at most so many characters a line, and ``-h`` asks for it, too.
_CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 96}


@dataclass
class _Listed:
    """A command as the help lists it, without importing its module."""

    name: str
    module: str  # its name in this folder
    says: str  # the sentence of the help

    def load(self) -> click.Command:
        """Import the module and return the command.

        A module has a function, or a click command, of the command's name with underscores. The
        options of a function are made from its parameters and its docstring.
        """
        module: Any = import_module(f"lockedjoint.commands.{self.module}")
        made: Any = getattr(module, self.name.replace("-", "_"))
        if isinstance(made, click.Command):
            return made
        from lockedjoint.commands.examples import examples
        from lockedjoint.commands.options import command

        return command(made, epilog=examples(self.name), short_help=self.says)


class _Lockedjoint(click.Group):
    """The group of all commands, whose help lists them under headings."""

    def list_commands(self, ctx: click.Context | None) -> list[str]:  # noqa: ARG002
        """Return the names of the commands, as the help lists them."""
        return [name for section in GROUPS.values() for name in section]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command, whose module is then imported."""
        if cmd_name not in self.commands:
            for section in GROUPS.values():
                if cmd_name in section:
                    self.commands[cmd_name] = _Listed(cmd_name, *section[cmd_name]).load()
        return super().get_command(ctx, cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the names and first sentences of the commands, a section a heading."""
        for heading, section in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(name, says) for name, (_, says) in section.items()])


@click.group("lockedjoint", cls=_Lockedjoint, context_settings=_CONTEXT, no_args_is_help=False)
@click.version_option(__version__, message="lockedjoint %(version)s", help="Show the version.")
@click.option(
    "--plugin",
    metavar="FILE.py",
    multiple=True,
    help="A Python file with formulations or joints of your own, which all commands then know "
    "by name; it goes before the command. May be repeated.",
)
def app(plugin: tuple[str, ...]) -> None:
    """Design and certify optimally failure-tolerant manipulator Jacobians.

    Start with `lockedjoint compare`. Exit status: 0 when done, 1 when a check failed or what
    was asked for was not found, 2 for input that is not allowed, 130 after Ctrl-C (what was
    done is kept).
    """
    for file in plugin:
        from lockedjoint.commands import plugins

        plugins.load(Path(file))
