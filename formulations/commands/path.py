"""``lockedjoint path``: the trajectory along which most joints may lock."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

from formulations.commands.arguments import FigureOptions, Json, Seed, option
from formulations.commands.output import (
    INTERRUPTED,
    as_table,
    as_text,
    end,
    progress,
    say,
    show,
    warn,
)
from formulations.commands.robot_arguments import ChainOptions, read_limits

if TYPE_CHECKING:
    from formulations.paths.plan import PathPlan

_FILES = ("path.csv", "path.json", "path.svg")


def path(
    robot: ChainOptions,
    *,
    waypoints: Path = option(
        "FILE",
        "CSV or JSON, in order of time: columns x,y,z and, for poses, roll,pitch,yaw or"
        " qx,qy,qz,qw; t besides if times are given.",
        ...,
    ),
    task: str | None = option(
        "DIRECTIONS",
        "Directions to be kept: all, position, or some of vx,vy,vz,wx,wy,wz; by default"
        " all for poses, position for positions.",
    ),
    limits: list[str] | None = option(
        "JOINT=LOWER:UPPER", "Narrower limits of a joint, radians or metres. May be repeated."
    ),
    duration: float = option(
        "SECONDS", "Of the whole path, if no t is given.", 10.0, positive=True
    ),
    samples: int = option(
        "N", "Samples of the path at which failures are tried.", 60, low=3, high=2000
    ),
    tracks: int = option(
        "K",
        "Candidate trajectories of the joints, which the search combines.",
        240,
        low=8,
        high=10_000,
    ),
    seed: Seed = 0,
    out: Path | None = option("DIR", "Write path.csv, path.json and path.svg there."),
    figure: FigureOptions,
    as_json: Json = False,
) -> None:
    """Find the joint trajectory along which most joints may lock at most times.

    A failure is survived if the other joints can finish the path within their limits, without
    leaving it. The search takes tens of seconds. The share that survives is measured by a test
    of its own, beside that of the minimum-norm trajectory and of the best of
    all configurations tried at each sample. Collisions are not checked.
    """
    from formulations.io.files import prepare_file
    from formulations.kinematics.chain import narrowed
    from formulations.paths.search import PathSearch, plan_path
    from formulations.paths.waypoints import read_waypoints
    from formulations.robots.robot_arm import RobotArm
    from formulations.robots.task import TaskSpace

    wanted = read_waypoints(waypoints)
    directions = task or ("all" if wanted.has_orientation else "position")
    chain = narrowed(robot.chain(), read_limits(limits))
    arm = RobotArm(chain, TaskSpace.parse(directions, "base"))
    if out is not None:
        from formulations.plot.style import figure_class

        figure_class()  # a missing package is better known at once
        for name in _FILES:
            prepare_file(out / name, inputs=[robot.file, waypoints, figure.style])
    look = figure.look()
    search = PathSearch(samples, duration, tracks, seed=seed, progress=progress)
    plan = plan_path(arm, wanted, search)
    warn(*(f"Note: {note}" for note in chain.notes))
    plain = {"robot": chain.robot, "tip": chain.tip, "seed": seed, **plan.to_dict()}
    if out is not None:
        from formulations.plot.style import looking

        with looking(look):
            _write(plan, plain, out)
    show(plain, as_json, lambda _: _text(plan))
    if out is not None and not as_json:
        say(f"\nWritten to {out}: {', '.join(_FILES)}")
    if not plan.complete:
        end("Interrupted: this is the best trajectory found by then.", INTERRUPTED)


def _write(plan: PathPlan, plain: dict[str, object], out: Path) -> None:
    from formulations.io.files import write_bytes, write_text
    from formulations.plot.robots import draw_path
    from formulations.plot.style import content

    drawn = content(draw_path(plan), "svg")
    lines = io.StringIO()
    csv.writer(lines, lineterminator="\n").writerows(plan.csv_lines())
    write_text(out / "path.json", json.dumps(plain, indent=1) + "\n")
    write_text(out / "path.csv", lines.getvalue())
    write_bytes(out / "path.svg", drawn)


def _text(plan: PathPlan) -> str:
    values = {k: v for k, v in plan.to_dict().items() if not isinstance(v, (dict, list))}
    return f"{as_text(values)}\n\n{as_table(plan.joint_rows())}"
