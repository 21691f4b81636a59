"""``lockedjoint path``: the trajectory along which most joints may lock."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lockedjoint.commands.arguments import FigureOptions, Seed, by_joint, flag, option
from lockedjoint.commands.output import INTERRUPTED, Answer, as_table, as_text, progress
from lockedjoint.commands.robot_arguments import ChainOptions, ClearanceOptions, LimitOptions
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.paths.plan import PathPlan
    from lockedjoint.paths.timing import MotionLimits, TimedTrajectory

_FILES: tuple[str, ...] = ("path.csv", "path.json", "path.svg")
_RECOVERIES = "recoveries.npz"


@dataclass(frozen=True)
class TimingOptions:
    """How fast a controller may run."""

    acceleration_limits: str | None = option(
        "A,…",
        "Largest accelerations of the joints, rad/s² or m/s², or one for all. With it the "
        "trajectory is timed, from rest to rest, and --out has it in time, too. Needs toppra.",
    )
    velocity_limits: str | None = option(
        "V,…", "Largest velocities, rad/s or m/s, or one for all; by default those of the file."
    )
    corners: Literal["blend", "stop"] = option(
        None, "Pass waypoints on a smooth curve through all samples, or rest at each.", "blend"
    )
    step: float = option(
        "SECONDS", "Time between two points of the timed trajectory.", 0.01, positive=True
    )

    def limits(self, chain: Chain) -> MotionLimits | None:
        """Read them; None if no accelerations were given; else as `MotionLimits.of`."""
        if self.acceleration_limits is None:
            if self.velocity_limits is not None:
                raise InputError("--velocity-limits", "alone", "with --acceleration-limits")
            return None
        from lockedjoint.paths.timing import MotionLimits

        count, given = len(chain.joints), self.velocity_limits
        return MotionLimits.of(
            chain,
            by_joint(self.acceleration_limits, "--acceleration-limits", count),
            None if given is None else by_joint(given, "--velocity-limits", count),
        )

    def timed(self, chain: Chain, plan: PathPlan, limits: MotionLimits) -> TimedTrajectory:
        """Return a plan in time."""
        from lockedjoint.paths.timing import timed

        waypoints = [k for k, at in enumerate(plan.places) if abs(at - round(at)) < 1e-9]
        stops = waypoints if self.corners == "stop" else []
        return timed(chain, plan.planned.configurations, limits, stops, self.step)


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
        "SECONDS", "Duration of the whole path, if no t is given.", 10.0, positive=True
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
    timing: TimingOptions,
    recover: bool = flag(
        "--recover",
        "Write recoveries.npz to --out, too: how to go on after each failure that is survived.",
    ),
    apart: ClearanceOptions,
    seed: Seed = 0,
    out: Path | None = option(
        "DIR",
        "Write path.csv, path.json and path.svg there; of a timed trajectory trajectory.csv, "
        "trajectory.json, and trajectory.yaml, ROS's JointTrajectory.",
    ),
    figure: FigureOptions,
) -> Answer:
    """Find the joint trajectory along which most joints may lock at most times.

    A failure is survived if the other joints can finish the path within their limits, without
    leaving it. The search takes seconds, or tens of seconds for arms with several redundant
    joints. A separate test measures the share of failures that is survived; the shares of the
    minimum-norm trajectory and of the best of all configurations tried at each sample are shown
    beside it. With --clearance or --obstacles links keep their distance at the samples; between
    samples, and after a failure that is survived, they touch nothing.
    """
    from lockedjoint.clearance.motion import ClearMotion
    from lockedjoint.figures.style import content, figure_class, looking
    from lockedjoint.formulations.io.files import (
        csv_text,
        prepare_file,
        write_bytes,
        write_text,
    )
    from lockedjoint.kinematics.chain import narrowed
    from lockedjoint.kinematics.task_space import TaskSpace
    from lockedjoint.paths.search import PathSearch, plan_path
    from lockedjoint.paths.timing import TRAJECTORY_FILES
    from lockedjoint.paths.waypoints import read_waypoints
    from lockedjoint.robots.robot_arm import RobotArm

    wanted = read_waypoints(waypoints)
    directions = task or ("all" if wanted.has_orientation else "position")
    whole = robot.chain()
    chain = narrowed(whole, limits.read(whole.names))
    arm = RobotArm(chain, TaskSpace.parse(directions, "base"))
    fastest = timing.limits(chain)
    if recover and out is None:
        raise InputError("--recover", "without --out", "with a folder to write to")
    clearance = apart.read(robot.file, chain)
    if out is not None:
        figure_class()  # a missing package is better known at once
        inputs = [robot.file, waypoints, figure.style, apart.obstacles]
        for name in (*_FILES, *TRAJECTORY_FILES, _RECOVERIES):
            prepare_file(out / name, inputs=inputs)
    look = figure.look()
    search = PathSearch(samples, duration, tracks, seed=seed, progress=progress)
    plan = plan_path(arm, wanted, search, clearance)
    plain = {"robot": chain.robot, "tip": chain.tip, "seed": seed, **plan.to_dict()}
    plain["task"] = list(arm.task.directions)
    run = None if fastest is None else timing.timed(chain, plan, fastest)
    if run is not None and clearance is not None:
        run.check_clear(ClearMotion(clearance, chain))
    # Whether the search for the trajectory ended, too: controllers read this file alone.
    timed = run and {"complete": plan.complete, **run.to_dict()}
    plain["timed"] = timed
    brief = {k: v for k, v in plan.to_dict().items() if not isinstance(v, (dict, list))}
    if plan.closest is not None:
        pair = " and ".join(plan.closest.links)
        brief["closest"] = f"{plan.closest.distance:.4g} m: {pair}"
    if run is not None:
        names = ("duration", "speed", "acceleration", "off_path")
        brief |= {f"timed {name}": getattr(run, name) for name in names}
    text = f"{as_text(brief)}\n\n{as_table(plan.joint_rows())}"
    if out is not None:
        from lockedjoint.figures.robots import draw_path

        with looking(look):
            drawn = content(draw_path(plan), "svg")
        write_text(out / "path.json", json.dumps(plain, indent=1) + "\n")
        write_text(out / "path.csv", csv_text(plan.csv_lines()))
        files = _FILES
        if run is not None:
            for name, written in run.files(complete=plan.complete).items():
                files += (name,)
                write_text(out / name, written)
        if recover:
            from lockedjoint.paths.plan import continuations

            files += (_RECOVERIES,)
            write_bytes(out / _RECOVERIES, continuations(arm, plan, seed, clearance))
        write_bytes(out / "path.svg", drawn)
        text += f"\n\nWritten to {out}: {', '.join(files)}"
    if plan.complete:
        return Answer(plain, text, notes=chain.notes)
    sentence = "Interrupted: this is the best trajectory found by then."
    return Answer(plain, text, notes=chain.notes, failure=[sentence], status=INTERRUPTED)
