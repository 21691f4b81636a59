"""The command line ``lockedjoint``: its commands in groups, each with two examples."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from lockedjoint import __version__
from lockedjoint.commands import (
    atlas,
    bound,
    campaign,
    path,
    prove,
    realise,
    recover,
    results,
    robots,
    solve,
    view,
    workspace,
)
from lockedjoint.commands.arguments import option, register

# In the order in which the help lists them: functions, and groups of commands.
_GROUPS: dict[str, tuple[Any, ...]] = {
    "Design": (results.compare, solve.solve, solve.measure, realise.realise),
    "Certify": (bound.app, prove.prove, prove.verify),
    "Robots": (
        *(robots.measure_robot, robots.posture, path.path, recover.recover),
        *(workspace.workspace, workspace.prove_workspace),
        *(view.view, robots.codegen),
    ),
    "Many starts": (campaign.campaign, campaign.show, campaign.join, atlas.app),
    "Results": (results.reproduce, results.figure),
}
# Of each command and of those within groups: the end of its help.
_EXAMPLES = """
compare
compare --joints 4 --task-dimension 2 --starts 20 --out planar
solve max-min --joints 8 --out best.json
solve residual --model lever-revolute:5,prismatic:2 --starts 500
measure best.json
measure best.json --locked 2 --json
realise best.json --to urdf --out arm.urdf
realise best.json --criterion neighbourhood --to figure --out arm.svg
bound
bound record --joints 8
bound worst-case --joints 8
bound two-point --joints 9
bound planar --joints 7 --locked 3 --level 0.97
bound residual --out bound.json
bound max-min
prove --out certificate.json
prove --joints 9
verify certificate.json
verify
measure-robot arm.urdf --tip tool
measure-robot arm.urdf --configuration posture.json --locked 2
posture arm.urdf --out posture.json
posture arm.urdf --at 0.4,0.1,0.5 --tolerance 0.01
path arm.urdf --waypoints way.csv
path arm.urdf --waypoints way.csv --limits elbow=0:2 --out plan
recover arm.urdf --at 0,0.5,0,-1.5,0,1,0 --locked elbow --goal 0.4,0.1,0.5
recover arm.urdf --locked elbow=1.2 --goal pose.json --out recovery
workspace arm.urdf --optimise limits
workspace arm.urdf --limits elbow=0:2 --figure workspace.svg
prove-workspace arm.urdf --limits elbow=0:2 --out kept.npz
prove-workspace arm.urdf --finest 0.01 --halvings 2
view arm.urdf
view arm.urdf --trajectory plan/path.json
codegen arm.urdf --out code
codegen arm.urdf --tip tool --task position --name arm
campaign study.toml --store study.db
campaign study.toml --store study.db --workers 8 --time-limit 60
show study.db
show study.db --where 'joints == 8' --to csv --out table.csv
join all.db one.db two.db
join copy.db study.db
atlas
atlas --joints 7 --mark open
atlas show unit-revolute_6x7_k1
atlas verify
atlas export site
atlas submit best.json --by 'A. Name' --out entries
atlas improve free-mean_2x7_k3 --minutes 30
reproduce
reproduce --starts 20 --out here
figure trade-off --out trade-off.svg
figure optima --store study.db --out optima.pdf --size 8.5x6 --no-title
"""


class _Listing(TyperGroup):
    """A group whose help lists its commands with their first sentences, under headings."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the names and first sentences of the commands, a section a heading."""
        headings = GROUPS if ctx.parent is None else {"Commands": tuple(self.commands)}
        for heading, names in headings.items():
            with formatter.section(heading):
                listed = [self.commands[name] for name in names]
                formatter.write_dl([(one.name, one.get_short_help_str(96)) for one in listed])


def _examples(words: str) -> str:
    """Return the end of a command's help, of a group's those of its commands, too."""
    lines = [line for line in _EXAMPLES.splitlines() if f"{line} ".startswith(f"{words} ")]
    return "\n".join(["\b\nExamples:", *(f"  lockedjoint {line}" for line in lines)])


app = typer.Typer(
    name="lockedjoint",
    cls=_Listing,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96},
)
#: Names of the commands under the headings of the help.
GROUPS: dict[str, list[str]] = {heading: [] for heading in _GROUPS}
for _heading, _commands in _GROUPS.items():
    for _command in _commands:
        if isinstance(_command, typer.Typer):
            _name = str(_command.info.name)
            app.add_typer(_command, cls=_Listing, epilog=_examples(_name))
            for _own in _command.registered_commands:
                _own.epilog = _examples(f"{_name} {_own.name}")
        else:
            _name = _command.__name__.replace("_", "-")
            register(app)(_command)
            app.registered_commands[-1].epilog = _examples(_name)
        GROUPS[_heading].append(_name)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"lockedjoint {__version__}")
        raise typer.Exit


@app.callback()
def lockedjoint(
    version: Annotated[  # noqa: ARG001
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version."
        ),
    ] = False,
    plugin: list[Path] | None = option(
        "FILE.py",
        "A Python file with formulations or joints of your own, which all commands then"
        " know by name. May be repeated.",
    ),
) -> None:
    """Design and certify optimally failure-tolerant manipulator Jacobians.

    Start with `lockedjoint compare`. Exit status: 0 when done, 1 when a check failed or what
    was asked for was not found, 2 for input that is not allowed, 130 after Ctrl-C (what was
    done is kept).
    """
    for file in plugin or ():
        from lockedjoint.formulations.registry import load_plugin

        load_plugin(file)
