"""``lockedjoint path``: the trajectory along which most joints may lock."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands import robot_arguments as robot
from formulations.commands.arguments import (
    Json,
    Seed,
    Size,
    Style,
    look,
    positive_option,
    progress,
    refuse_unused,
    whole_option,
)
from formulations.commands.output import INTERRUPTED, as_text, show
from formulations.io.table import written
from nlp.errors import InputError

if TYPE_CHECKING:
    from formulations.paths.plan import PathPlan

_FILES = ("path.csv", "path.json", "path.svg")


def path(
    context: typer.Context,
    file: robot.File,
    waypoints: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="CSV or JSON, in order of time: columns x,y,z and, for poses, roll,pitch,yaw "
            "or qx,qy,qz,qw; t besides if times are given.",
        ),
    ],
    tip: robot.Tip = None,
    base: robot.Base = None,
    point: robot.Point = None,
    task: Annotated[
        str | None,
        typer.Option(
            metavar="DIRECTIONS",
            help="Directions to be kept: all, position, or some of vx,vy,vz,wx,wy,wz.",
            show_default="all for poses, position for positions",
        ),
    ] = None,
    held: robot.Held = None,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--limits",
            metavar="JOINT=LOWER:UPPER",
            help="Narrower limits of a joint, radians or metres. May be repeated.",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[
        float,
        positive_option("SECONDS", "For the whole path, if no t is given."),
    ] = 10.0,
    samples: Annotated[int, whole_option(3, "N", "Samples of the path.", 2000)] = 60,
    tracks: Annotated[int, whole_option(8, "K", "Candidate tracks.", 10_000)] = 80,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write path.csv, path.json and path.svg there."),
    ] = None,
    size: Size = None,
    style: Style = None,
    as_json: Json = False,
) -> None:
    """Find the joint trajectory along which most joints may lock at most times.

    A failure is survived if the other joints can finish the path within their limits, without
    leaving it. The search takes tens of seconds. The share that survives is measured by a test
    of its own, beside that of the minimum-norm trajectory and a ceiling by sampling.
    """
    from formulations.kinematics.chain import narrowed
    from formulations.paths.search import PathSearch, plan_path
    from formulations.paths.waypoints import read_waypoints
    from formulations.robots.robot_arm import RobotArm
    from nlp.files import prepare_file, write_bytes, write_text

    if out is None:
        refuse_unused(context, ("size", "style"), "no --out")
    wanted = read_waypoints(waypoints)
    task = task or ("all" if wanted.has_orientation else "position")
    arm = robot.arm(file, tip, base, point, task, "base", None, held)
    arm = RobotArm(narrowed(arm.chain, _limits(limits or [])), arm.task)
    if out is not None:
        from formulations.plot.style import figure_class

        figure_class()  # a missing package is better known at once
        for name in _FILES:
            prepare_file(out / name, inputs=[file, waypoints, style])
    looks = look(size, False, style)
    search = PathSearch(samples, duration, tracks, seed=seed, progress=progress)
    found = plan_path(arm, wanted, search)
    progress("")
    for note in arm.chain.notes:
        typer.echo(f"Note: {note}", err=True)
    plain = {"robot": arm.chain.robot, "tip": arm.chain.tip, "seed": seed, **found.to_dict()}
    if out is not None:
        from formulations.plot.path import draw
        from formulations.plot.style import content, looking

        with looking(looks):
            drawn = content(draw(found), "svg")
        write_text(out / "path.json", json.dumps(plain, indent=1) + "\n")
        lines = io.StringIO()
        csv.writer(lines, lineterminator="\n").writerows(found.csv_lines())
        write_text(out / "path.csv", lines.getvalue())
        write_bytes(out / "path.svg", drawn)
    show(plain, as_json, lambda _: _text(found))
    if out is not None and not as_json:
        typer.echo(f"\nWritten to {out}: {', '.join(_FILES)}")
    if not found.complete:
        typer.echo("Interrupted: this is the best trajectory found by then.", err=True)
        raise typer.Exit(INTERRUPTED)


def _limits(settings: list[str]) -> dict[str, tuple[float, float]]:
    found: dict[str, tuple[float, float]] = {}
    for setting in settings:
        joint, equals, ends = setting.partition("=")
        lower, colon, upper = ends.partition(":")
        if not (joint and equals and colon):
            raise InputError("--limits", setting, "JOINT=LOWER:UPPER, radians or metres")
        name = joint.strip()
        if name in found:
            raise InputError("--limits", f"{name} twice", "every joint once")
        where = f"--limits of {name}"
        found[name] = robot.number(where, lower), robot.number(where, upper)
    return found


def _text(found: PathPlan) -> str:
    base = found.minimum_norm
    missing = "none completes the path"
    values = {
        "survives": f"{found.planned.share:.1f} % of all failures",
        "minimum norm": missing if base is None else f"{base.share:.1f} %",
        "ceiling": f"{found.ceiling:.1f} % (by sampling {found.nodes} configurations)",
        "least sigma": float(found.planned.sigma.min()),
        "least sigma, minimum norm": base and float(base.sigma.min()),
        "largest speed": f"{100 * found.speed:.0f} % of its limit",
        "off the path between samples": f"{1000 * found.deviation:.2g} mm",
    }
    rows = []
    for line in found.joint_rows():
        ends, unrecoverable = line["others_end"], line["unrecoverable_until"]
        rows.append(
            [
                str(line["joint"]),
                *(
                    _percent(line[name])
                    for name in ("percent", "minimum_norm_percent", "ceiling_percent")
                ),
                "–" if unrecoverable is None else f"until {unrecoverable:.3g} s",
                "–" if not isinstance(ends, list) else f"{ends[0]:.3g} to {ends[1]:.3g} s",
            ]
        )
    heads = [
        "joint",
        "survives %",
        "minimum norm %",
        "ceiling %",
        "unrecoverable",
        "others end",
    ]
    table = written(rows, heads, "pipe")
    ending = (
        "Unrecoverable: its ranges at later samples have no position in common; no trajectory "
        "survives."
    )
    return f"{as_text(values)}\n\n{table}\n\n{ending}"


def _percent(value: object) -> str:
    return f"{value:.1f}" if isinstance(value, float) else "–"
