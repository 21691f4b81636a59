"""``lockedjoint path``: the trajectory along which most joints may lock.

What comes in: a robot, a file of the tool's waypoints, how to search, and how fast the joints
may move. What goes out: an `Answer` with text and JSON, and with --out-dir the files of
`_PATH_FILES`, of `TRAJECTORY_FILES` if the trajectory is timed, and `_RECOVERIES_FILE` if
--recoveries asks for it. The search is in `lockedjoint.paths`.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import FieldsOf, Only
from lockedjoint.commands.output import INTERRUPTED, Answer, as_table, as_text
from lockedjoint.commands.shared import (
    NOT_CHECKED,
    RobotOnPath,
    check_style,
    checked_effort,
    looking_like,
    source_file,
)
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.nlp.errors import InputError, MissingLibraryError
from lockedjoint.paths.path_search import PathSearch, Timing

if TYPE_CHECKING:
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.paths.motion_limits import MotionLimits
    from lockedjoint.paths.plan import PathPlan
    from lockedjoint.paths.timing import TimedTrajectory

# Files that every path has.
_PATH_FILES = ("path.csv", "path.json")
# File with the picture; without matplotlib it is left out, with a note.
_PICTURE_FILE = "path.svg"
# File that says how to go on after each failure that is survived.
_RECOVERIES_FILE = "recoveries.npz"
# Distance of the timed tool from the path above which a note names remedies.
_LARGE_OFF_PATH_M = 1e-3
# Rows of the task that are the tool's position along x, y and z.
_POSITION_ROWS = {0, 1, 2}
# Names under which values are printed: they say the units.
_UNITS = {"largest_speed": "largest speed (share of limit)", "deviation": "deviation (m)"}


def path(
    robot: RobotOnPath,
    waypoints: Path,
    search: Annotated[dict[str, Any], FieldsOf(PathSearch, ("duration", "seed"))],
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
        How much is tried. May be repeated: samples of the path at which failures are tried
        (60), tracks, candidate trajectories that the search combines (240), rounds (3).
    out_dir
        It gets path.csv, path.json and, if matplotlib is installed, path.svg; of a timed
        trajectory trajectory.csv, trajectory.json, trajectory.yaml, ROS's JointTrajectory, and
        trajectory.ros2_control.csv.
    """
    from lockedjoint.clearance.motion import ClearMotion
    from lockedjoint.formulations.io.files import (
        csv_text,
        prepare_file,
        write_bytes,
        write_text,
    )
    from lockedjoint.formulations.io.table import Table, chosen_names
    from lockedjoint.kinematics.chain import narrowed
    from lockedjoint.paths.plan import JointRow
    from lockedjoint.paths.search import (
        arm_along,
        check_times,
        plan_path,
        standing_at,
        with_approach,
    )
    from lockedjoint.paths.timing import TRAJECTORY_FILES
    from lockedjoint.paths.waypoints import read_waypoints
    from lockedjoint.robot import with_settings

    if columns is not None:  # a mistake is better known before the search
        columns = chosen_names("--columns", columns, Table(JointRow, []).columns(every=True))
    tool_path = read_waypoints(waypoints)
    settings = {"progress": progress, **search, **checked_effort(effort, PathSearch)}
    check_times(tool_path, settings)
    path_search = with_settings(PathSearch, None, settings)
    arm = arm_along(robot, tool_path)
    chain = arm.chain
    motion_limits = _motion_limits(chain, timing)
    if recoveries and out_dir is None:
        raise InputError("--recoveries", "without --out-dir", "with a folder to write to")
    if out_dir is not None:
        inputs = [source_file(robot), waypoints, figure_style]
        for name in (*_PATH_FILES, _PICTURE_FILE, *TRAJECTORY_FILES, _RECOVERIES_FILE):
            prepare_file(out_dir / name, "--out-dir", inputs)
    check_style(figure_style, out_dir is not None, "one with --out-dir")
    limits = limits and robot.in_radians(limits)
    standing = None if q is None else standing_at(robot, q, limits)
    plan = plan_path(arm, tool_path, path_search, robot.apart, limits)
    if standing is not None:
        plan = with_approach(plan, robot, *standing, path_search.seed, limits)
    plain: dict[str, Any] = {"robot": chain.robot, "base": chain.base, "tip": chain.tip}
    plain |= {"locked": dict(chain.locked_at), "seed": path_search.seed, **plan.to_dict()}
    plain["task"] = list(arm.task.directions)
    until_failure = narrowed(chain, limits or {})
    notes = (*until_failure.notes, *tool_path.notes)
    notes += () if plan.approach is None else plan.approach.notes
    if robot.apart is not None:
        plain["unchecked_links"] = list(robot.apart.unchecked)
        notes += robot.apart.notes
    timed = None
    if motion_limits is not None:
        has_position = set(arm.task.rows) >= _POSITION_ROWS
        timed = _timed(until_failure, plan, motion_limits, timing, has_position)
        if robot.apart is not None:
            timed.check_clear(ClearMotion(robot.apart, chain))
        notes += _off_path(timed, timing) if has_position else ()
    # Controllers read this part alone: it also says whether the search ended.
    plain["timed"] = timed and {"complete": plan.complete, **timed.to_dict()}
    text = f"{as_text(_summary(plan, timed))}\n\n{as_table(plan.joint_rows(), columns=columns)}"
    if out_dir is not None:
        write_text(out_dir / "path.json", json.dumps(plain, indent=1) + "\n")
        write_text(out_dir / "path.csv", csv_text(plan.csv_lines()))
        written = list(_PATH_FILES)
        if timed is not None:
            for name, content_of_file in timed.files(complete=plan.complete).items():
                write_text(out_dir / name, content_of_file)
                written.append(name)
        if recoveries:
            from lockedjoint.paths.plan import continuations

            archive = continuations(arm, plan, path_search.seed, robot.apart)
            write_bytes(out_dir / _RECOVERIES_FILE, archive)
            written.append(_RECOVERIES_FILE)
            text += _of_recoveries(archive)
        try:
            write_bytes(out_dir / _PICTURE_FILE, _picture(plan, figure_style))
            written.append(_PICTURE_FILE)
        except MissingLibraryError as missing:
            notes += (f"{_PICTURE_FILE} is not written: {missing}",)
        text += f"\n\nWritten to {out_dir}: {', '.join(written)}"
    if plan.complete:
        return Answer(plain, text, notes=notes)
    sentence = "Interrupted: this is the best trajectory found by then."
    return Answer(plain, text, notes=notes, failure=[sentence], status=INTERRUPTED)


def _picture(plan: PathPlan, style: Path | None) -> bytes:
    """Return the content of the picture; MissingLibraryError without matplotlib."""
    from lockedjoint.figures.robots import draw_path
    from lockedjoint.figures.style import content

    with looking_like(style):
        return content(draw_path(plan), "svg")


def _of_recoveries(content: bytes) -> str:
    """Return a line on how near links come after failures, where they have to stay apart."""
    import io

    import numpy as np

    closest = np.load(io.BytesIO(content), allow_pickle=False).get("closest")
    if closest is None or not np.isfinite(closest).any():
        return ""
    return f"\n\nAfter failures links come as near as {np.nanmin(closest):.4g} m."


def _summary(plan: PathPlan, timed: TimedTrajectory | None) -> dict[str, Any]:
    """Return the numbers that the text shows above the table of joints."""
    hidden = ("unit_of_times", "approach")
    summary = {
        _UNITS.get(name, name): value
        for name, value in plan.to_dict().items()
        if not isinstance(value, dict | list) and name not in hidden
    }
    if plan.closest is None:
        summary["collisions"] = NOT_CHECKED
    else:
        summary["closest"] = str(plan.closest)
    if plan.approach is not None:
        summary["approach"] = str(plan.approach)
    if timed is not None:
        summary |= {f"timed {name}": value for name, value in timed.summary().items()}
        summary["timed off path (m)"] = timed.off_path
    return summary


def _off_path(timed: TimedTrajectory, timing: Timing) -> tuple[str, ...]:
    """Return a sentence with remedies if the timed tool is far from the path, or none."""
    if timed.off_path <= _LARGE_OFF_PATH_M:
        return ()
    rests = timing.corners == "stop"
    remedy = "more --effort samples=" + ("" if rests else ", or --corners stop")
    off_mm = 1000 * timed.off_path
    return (
        f"On the timed trajectory the tool is up to {off_mm:.2g} mm off the path: {remedy}.",
    )


def _motion_limits(chain: Chain, timing: Timing) -> MotionLimits | None:
    """Return how fast the joints may move; None if the trajectory is not to be timed."""
    if timing.acceleration is None:
        return None
    from lockedjoint.paths.motion_limits import MotionLimits, for_each, require_toppra

    require_toppra()  # A missing library is better known before the search.
    joint_count = len(chain.joints)
    accelerations = for_each("acceleration", timing.acceleration, joint_count).tolist()
    velocities = jerks = None
    if timing.velocity is not None:
        velocities = for_each("velocity", timing.velocity, joint_count).tolist()
    if timing.jerk is not None:
        jerks = for_each("jerk", timing.jerk, joint_count).tolist()
    return MotionLimits.of(chain, accelerations, velocities, jerks)


def _timed(
    chain: Chain, plan: PathPlan, limits: MotionLimits, timing: Timing, has_position: bool
) -> TimedTrajectory:
    """Return the planned trajectory with times, the way to its first sample before it.

    `has_position` says whether the task has the tool's whole position: then the distance from
    the path is measured, too.
    """
    import numpy as np

    from lockedjoint.paths.timing import joined, timed
    from lockedjoint.paths.waypoints import at_waypoints

    stops = []
    if timing.corners == "stop":
        stops = at_waypoints(plan.places).tolist()
    positions = plan.poses.positions if has_position else None
    q, step = plan.planned.configurations, timing.step
    on_path = timed(chain, q, limits, stops, step, positions, plan.places)
    if plan.approach is None or len(plan.approach.configurations) == 1:
        return on_path
    corners = plan.approach.configurations
    every, before = range(len(corners)), np.full(len(corners), plan.places[0])
    approach = timed(chain, corners, limits, every, step, places=before)
    both = joined([approach, on_path])
    return replace(both, off_path=on_path.off_path, begins=approach.duration)
