"""``lockedjoint path``: the trajectory along which most joints may lock."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

from formulations.commands.arguments import FigureOptions, Seed, option
from formulations.commands.output import INTERRUPTED, Answer, as_table, as_text, progress
from formulations.commands.robot_arguments import ChainOptions, LimitOptions

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
    limits: LimitOptions,
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
) -> Answer:
    """Find the joint trajectory along which most joints may lock at most times.

    A failure is survived if the other joints can finish the path within their limits, without
    leaving it. The search takes tens of seconds. The share that survives is measured by a test
    of its own, beside that of the minimum-norm trajectory and of the best of
    all configurations tried at each sample. Collisions are not checked.
    """
    from formulations.io.files import prepare_file, write_bytes, write_text
    from formulations.kinematics.chain import narrowed
    from formulations.paths.search import PathSearch, plan_path
    from formulations.paths.waypoints import read_waypoints
    from formulations.plot.style import content, figure_class, looking
    from formulations.robots.robot_arm import RobotArm
    from formulations.robots.task import TaskSpace

    wanted = read_waypoints(waypoints)
    directions = task or ("all" if wanted.has_orientation else "position")
    chain = narrowed(robot.chain(), limits.read())
    arm = RobotArm(chain, TaskSpace.parse(directions, "base"))
    if out is not None:
        figure_class()  # a missing package is better known at once
        for name in _FILES:
            prepare_file(out / name, inputs=[robot.file, waypoints, figure.style])
    look = figure.look()
    plan = plan_path(
        arm, wanted, PathSearch(samples, duration, tracks, seed=seed, progress=progress)
    )
    plain = {"robot": chain.robot, "tip": chain.tip, "seed": seed, **plan.to_dict()}
    brief = {k: v for k, v in plan.to_dict().items() if not isinstance(v, (dict, list))}
    text = f"{as_text(brief)}\n\n{as_table(plan.joint_rows())}"
    if out is not None:
        from formulations.plot.robots import draw_path

        with looking(look):
            drawn = content(draw_path(plan), "svg")
        lines = io.StringIO()
        csv.writer(lines, lineterminator="\n").writerows(plan.csv_lines())
        write_text(out / "path.json", json.dumps(plain, indent=1) + "\n")
        write_text(out / "path.csv", lines.getvalue())
        write_bytes(out / "path.svg", drawn)
        text += f"\n\nWritten to {out}: {', '.join(_FILES)}"
    if plan.complete:
        return Answer(plain, text, notes=chain.notes)
    sentence = "Interrupted: this is the best trajectory found by then."
    return Answer(plain, text, notes=chain.notes, failure=[sentence], status=INTERRUPTED)
