"""``lockedjoint path``: the trajectory along which most joints may lock."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import LATER, Only
from lockedjoint.commands.output import INTERRUPTED, Answer, as_table, as_text
from lockedjoint.commands.shared import RobotOnPath, look_of, looking_like, source_file
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.path_search import PathSearch, Timing

if TYPE_CHECKING:
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.paths.motion_limits import MotionLimits
    from lockedjoint.paths.plan import PathPlan
    from lockedjoint.paths.timing import TimedTrajectory

_FILES: tuple[str, ...] = ("path.csv", "path.json", "path.svg")
_RECOVERIES = "recoveries.npz"
# Values are printed under these names, which say their units.
_UNITS = {"largest_speed": "largest speed (share of limit)", "deviation": "deviation (m)"}


def path(
    robot: RobotOnPath,
    waypoints: Path,
    search: Annotated[PathSearch, Only(("duration", "seed")), LATER],
    timing: Annotated[Timing, Only(("acceleration", "velocity", "jerk", "corners"))],
    limits: Mapping[str, tuple[float, float]] | None = None,
    q: str | InDegrees | None = None,
    recoveries: bool = False,
    effort: Mapping[str, Any] | None = None,
    columns: list[str] | None = None,
    out_dir: Path | None = None,
    figure_style: Path | None = None,
) -> Answer:
    """Find the joint trajectory along which most joints may lock at most times.

    A failure is survived if the other joints can finish the path within their limits, without
    leaving it. The search takes seconds, or tens of seconds for arms with several redundant
    joints. A separate test measures the share of failures that is survived; the shares of the
    minimum-norm trajectory and of the best of all configurations tried at each sample are shown
    beside it. With --clearance or --obstacles links keep their distance at the samples; between
    samples, and after a failure that is survived, they touch nothing.

    Parameters
    ----------
    q
        Where the arm stands, also as the state of a whole robot: the way from there to the
        first waypoint is found too, and begins the timed trajectory. By default the first
        waypoint.
    recoveries
        Whether recoveries.npz is written to --out-dir, too: how to go on after each failure
        that is survived.
    effort
        samples of the path at which failures are tried (60), tracks, candidate trajectories
        that the search combines (240), rounds (3).
    out_dir
        It gets path.csv, path.json and path.svg; of a timed trajectory trajectory.csv,
        trajectory.json, trajectory.yaml, ROS's JointTrajectory, and
        trajectory.ros2_control.csv.
    """
    from lockedjoint.clearance.motion import ClearMotion
    from lockedjoint.figures.style import content, figure_class
    from lockedjoint.formulations.io.files import (
        csv_text,
        prepare_file,
        write_bytes,
        write_text,
    )
    from lockedjoint.paths.search import arm_along, plan_path, standing_at, with_approach
    from lockedjoint.paths.timing import TRAJECTORY_FILES
    from lockedjoint.paths.waypoints import read_waypoints
    from lockedjoint.robot import with_settings

    wanted = read_waypoints(waypoints)
    given: Any = {"progress": progress, **search, **(effort or {})}  # type: ignore[dict-item]
    chosen = with_settings(PathSearch, None, given)
    arm = arm_along(robot, wanted)
    chain = arm.chain
    fastest = _limits(chain, timing)
    if recoveries and out_dir is None:
        raise InputError("--recoveries", "without --out-dir", "with a folder to write to")
    if out_dir is not None:
        figure_class()  # a missing package is better known at once
        inputs = [source_file(robot), waypoints, figure_style]
        for name in (*_FILES, *TRAJECTORY_FILES, _RECOVERIES):
            prepare_file(out_dir / name, "--out-dir", inputs)
    look_of(figure_style)
    standing = None if q is None else standing_at(robot, q)
    plan = plan_path(arm, wanted, chosen, robot.apart, limits and robot.in_radians(limits))
    if standing is not None:
        plan = with_approach(plan, robot, *standing, chosen.seed)
    plain = {"robot": chain.robot, "tip": chain.tip, "seed": chosen.seed, **plan.to_dict()}
    plain["task"] = list(arm.task.directions)
    notes = (*chain.notes, *wanted.notes)
    notes += () if plan.approach is None else plan.approach.notes
    if robot.apart is not None:
        plain["unchecked_links"] = list(robot.apart.unchecked)
        notes += robot.apart.notes
    placed = {0, 1, 2} <= set(arm.task.rows)
    run = None if fastest is None else _timed(chain, plan, fastest, timing, placed)
    if run is not None and robot.apart is not None:
        run.check_clear(ClearMotion(robot.apart, chain))
    # Whether the search for the trajectory ended, too: controllers read this file alone.
    plain["timed"] = run and {"complete": plan.complete, **run.to_dict()}
    text = f"{as_text(_brief(plan, run))}\n\n{as_table(plan.joint_rows(), columns=columns)}"
    if out_dir is not None:
        from lockedjoint.figures.robots import draw_path

        write_text(out_dir / "path.json", json.dumps(plain, indent=1) + "\n")
        write_text(out_dir / "path.csv", csv_text(plan.csv_lines()))
        files = _FILES
        if run is not None:
            for name, written in run.files(complete=plan.complete).items():
                files += (name,)
                write_text(out_dir / name, written)
        if recoveries:
            from lockedjoint.paths.plan import continuations

            files += (_RECOVERIES,)
            done = continuations(arm, plan, chosen.seed, robot.apart)
            write_bytes(out_dir / _RECOVERIES, done)
            text += _of_recoveries(done)
        with looking_like(figure_style):
            write_bytes(out_dir / "path.svg", content(draw_path(plan), "svg"))
        text += f"\n\nWritten to {out_dir}: {', '.join(files)}"
    if plan.complete:
        return Answer(plain, text, notes=notes)
    sentence = "Interrupted: this is the best trajectory found by then."
    return Answer(plain, text, notes=notes, failure=[sentence], status=INTERRUPTED)


def _of_recoveries(content: bytes) -> str:
    """Return a line on how near links come after failures, where they have to stay apart."""
    import io

    import numpy as np

    closest = np.load(io.BytesIO(content), allow_pickle=False).get("closest")
    if closest is None or not np.isfinite(closest).any():
        return ""
    return f"\n\nAfter failures links come as near as {np.nanmin(closest):.4g} m."


def _brief(plan: PathPlan, run: TimedTrajectory | None) -> dict[str, Any]:
    plain = plan.to_dict().items()
    hidden = ("unit_of_times", "approach")
    shown = {k: v for k, v in plain if not isinstance(v, (dict, list)) and k not in hidden}
    brief = {_UNITS.get(name, name): value for name, value in shown.items()}
    if plan.closest is not None:
        brief["closest"] = str(plan.closest)
    if plan.approach is not None:
        brief["approach"] = str(plan.approach)
    if run is not None:
        brief |= {f"timed {name}": value for name, value in run.summary().items()}
        brief["timed off path (m)"] = run.off_path
    return brief


def _limits(chain: Chain, timing: Timing) -> MotionLimits | None:
    """Return how fast the joints may move; None if the trajectory is not to be timed."""
    if timing.acceleration is None:
        return None
    from lockedjoint.paths.motion_limits import MotionLimits, for_each

    count, fastest, roughest = len(chain.joints), timing.velocity, timing.jerk
    return MotionLimits.of(
        chain,
        for_each("acceleration", timing.acceleration, count).tolist(),
        None if fastest is None else for_each("velocity", fastest, count).tolist(),
        None if roughest is None else for_each("jerk", roughest, count).tolist(),
    )


def _timed(
    chain: Chain, plan: PathPlan, limits: MotionLimits, timing: Timing, whole: bool
) -> TimedTrajectory:
    """Return a plan in time; `whole` says whether the tool's whole position is asked for."""
    from lockedjoint.paths.timing import joined, timed

    waypoints = [k for k, at in enumerate(plan.places) if abs(at - round(at)) < 1e-9]
    stops = waypoints if timing.corners == "stop" else []
    path = plan.poses.positions if whole else None
    run = timed(chain, plan.planned.configurations, limits, stops, timing.step, path)
    if plan.approach is None or len(plan.approach.configurations) == 1:
        return run
    corners = plan.approach.configurations
    there = timed(chain, corners, limits, range(len(corners)), timing.step)
    both = joined([there, run])
    return replace(both, off_path=run.off_path, begins=there.duration)
