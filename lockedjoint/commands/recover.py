"""``lockedjoint recover``: reach the goal after a failure, or know that it is impossible.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import FieldsOf
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_text
from lockedjoint.commands.posture import near
from lockedjoint.commands.shared import DamagedRobot, checked_effort, source_file
from lockedjoint.formulations.io.files import real_in
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.nlp.errors import InputError
from lockedjoint.recovery.recovery_search import RecoverySearch

if TYPE_CHECKING:
    from lockedjoint.kinematics.pose import Pose
    from lockedjoint.paths.plan_in_time import RestOfPlan
    from lockedjoint.paths.waypoints import ToolPath
    from lockedjoint.recovery.answers import Recovery
    from lockedjoint.recovery.failures import Failure
    from lockedjoint.recovery.goal import ToolGoal

# File in --out-dir with the proof that the goal is out of reach.
_PROOF = "proof.json"
# Number of decimals of positions, radians or metres, at which a joint could have locked.
_DECIMALS = 3


def recover(
    robot: DamagedRobot,
    search: Annotated[dict[str, Any], FieldsOf(RecoverySearch, ("time_limit", "seed"))],
    q: str | None = None,
    locked: Mapping[str, float | None] | None = None,
    reduced: list[str] | None = None,
    at: Pose | None = None,
    tolerance: list[float] | None = None,
    task: str | None = None,
    waypoints: Path | None = None,
    acceleration: list[float] | None = None,
    velocity: list[float] | None = None,
    jerk: list[float] | None = None,
    effort: Mapping[str, Any] | None = None,
    out_dir: Path | None = None,
) -> Answer:
    """Reach a goal after joints have failed, or prove that no configuration does.

    The answer is one of four. Trajectory: one in time, which a separate routine checks.
    Impossible, proved: the joints that still move cannot reach the goal, collisions not
    considered, with all rounding errors bounded. Impossible, numerical: the same without bounds
    of the errors. Not found: a list of what was tried without success. Exit status 1 if there
    is no trajectory.

    Parameters
    ----------
    q
        Where the arm is, joints that fail included; by default midway between the limits.
    locked
        Joints that have locked, and where, in radians or metres; by default where --q has them.
        May be repeated.
    reduced
        A joint that is left a smaller range, JOINT=LOWER:UPPER in radians or metres, or a share
        of its speed, JOINT=SHARE; or a revolute one without torque and brake, JOINT=free, which
        hangs by gravity, along -z of the root: with --at alone, and a URDF file that has
        masses. May be repeated.
    task
        The directions of the tool that count: all, position, or some of vx,vy,vz,wx,wy,wz. They
        are along the axes of the base, or with tip: before them, as in tip:vz, of the tip at
        the goal. By default all count that the goal has.
    waypoints
        It is given instead of --at: the path that is to be followed, or its rest. FILE@SECONDS
        is the rest of a plan: FILE is the path.json of `path --out-dir`, and SECONDS when
        joints fail, as the column t (s) of trajectory.csv has it if the plan is timed, and
        otherwise that of path.csv. Then the plan says where the arm is, and --q is not given.
    acceleration
        Largest accelerations of the joints, rad/s² or m/s², or one for all; by default the
        largest velocity is reached in half a second.
    velocity
        Largest velocities of the joints, rad/s or m/s, or one for all; by default those of the
        file, or else 1.
    effort
        How much is tried. May be repeated: starts of inverse kinematics (1000), boxes of a
        proof at most (1000000).
    out_dir
        It gets trajectory.csv, trajectory.json, trajectory.yaml, ROS's JointTrajectory, and
        trajectory.ros2_control.csv; or proof.json, if the goal is proved to be out of reach.
    """
    from lockedjoint.formulations.io.files import prepare_file, write_text
    from lockedjoint.paths.plan_in_time import RestOfPlan
    from lockedjoint.paths.timing import TRAJECTORY_FILES
    from lockedjoint.recovery.recover import recover as recover_arm
    from lockedjoint.robot import with_settings

    goal = _goal(at, tolerance, task, waypoints)
    if q is not None and isinstance(goal, RestOfPlan):
        raise InputError("--q", q, "none with the rest of a plan, which has a configuration")
    failures = _failures(locked or {}, reduced or [], robot.in_radians)
    if out_dir is not None:
        inputs = [source_file(robot), None if waypoints is None else _plan_at(waypoints)[0]]
        for name in (*TRAJECTORY_FILES, _PROOF):
            prepare_file(out_dir / name, "--out-dir", inputs)
    settings = {"progress": progress, **search, **checked_effort(effort, RecoverySearch)}
    chosen = with_settings(RecoverySearch, None, settings)
    how = {"acceleration": acceleration, "velocity": velocity, "jerk": jerk}
    answer = recover_arm(robot, q, failures, goal, chosen, **how)
    plain = {"robot": robot.name, "tip": robot.tip, "seed": chosen.seed, **answer.to_dict()}
    shown: dict[str, object] = {}
    if isinstance(goal, RestOfPlan):
        plain |= {"plan": goal.to_dict()}
        shown = {"from the plan": str(goal)}
    text = _text(answer, shown)
    if out_dir is not None:
        files = {} if answer.trajectory is None else answer.trajectory.files()
        if answer.proof is not None:
            files = {_PROOF: json.dumps(answer.proof.content) + "\n"}
        for name, content in files.items():
            write_text(out_dir / name, content)
        if files:
            text += f"\n\nWritten to {out_dir}: {', '.join(files)}"
    if answer.trajectory is not None:
        return Answer(plain, text, notes=answer.notes)
    sentence = "The goal is out of reach of what can still move."
    if answer.verdict == "not found":
        sentence = "No trajectory was found, and no proof that there is none."
    return Answer(plain, text, notes=answer.notes, failure=[sentence], status=UNSUCCESSFUL)


def _failures(
    locked: Mapping[str, float | None] | InDegrees,
    reduced: list[str] | InDegrees,
    in_radians: Callable[[Any], Any] = lambda stated: stated,
) -> list[Failure]:
    """Return what has failed; InputError if nothing has.

    `locked` has positions by joint, None where a joint locks where it is; `reduced` has texts
    ``JOINT=REST``. Both may be in degrees: `in_radians` converts positions by joint.
    """
    from lockedjoint.kinematics.state import interval, number
    from lockedjoint.recovery import failures as kinds

    places = in_radians(locked)
    failures: list[Failure] = [kinds.Locked(name, place) for name, place in places.items()]
    degrees = isinstance(reduced, InDegrees)
    allowed = "JOINT=LOWER:UPPER, radians or metres, JOINT=SHARE, or JOINT=free"
    for setting in reduced.stated if isinstance(reduced, InDegrees) else reduced:
        name, _, left = (part.strip() for part in setting.rpartition("="))
        if not name:
            raise InputError("--reduced", setting, allowed)
        where = f"--reduced of {name}"
        if left == "free":
            failures.append(kinds.FreeSwinging(name))
        elif ":" in left:
            ends: Any = {name: interval(where, left)}
            ends = in_radians(InDegrees(ends) if degrees else ends)
            failures.append(kinds.ReducedRange(name, *ends[name]))
        else:
            failures.append(kinds.ReducedSpeed(name, number(where, left)))
    if not failures:
        raise InputError("failure", "missing", "one of --locked and --reduced")
    return failures


def _goal(
    at: Pose | None, tolerance: list[float] | None, task: str | None, waypoints: Path | None
) -> ToolGoal | ToolPath | RestOfPlan:
    """Return where the tool is to be; InputError if options contradict."""
    from lockedjoint.kinematics.task_space import TaskSpace
    from lockedjoint.paths.read_plan import read_plan
    from lockedjoint.paths.waypoints import read_waypoints
    from lockedjoint.recovery.goal import ToolGoal

    if (at is None) == (waypoints is None):
        given = "missing" if at is None else "given besides --waypoints"
        raise InputError("--at", given, "either --at or --waypoints")
    if waypoints is not None:
        for name, value in (("--tolerance", tolerance), ("--task", task)):
            if value is not None:
                raise InputError(name, value, "none with --waypoints")
        file, time = _plan_at(waypoints)
        return read_waypoints(file) if time is None else read_plan(file).after(time)
    pose = near(at, tolerance)
    assert pose is not None
    return ToolGoal(pose, None if task is None else TaskSpace.parse(task))


def _plan_at(waypoints: Path) -> tuple[Path, float | None]:
    """Return the file of waypoints, and the time in seconds after an @, if there is one."""
    file, at, time = str(waypoints).rpartition("@")
    if not at or waypoints.exists():
        return waypoints, None
    try:
        return Path(file), real_in(time)
    except ValueError:
        allowed = "FILE, or FILE@SECONDS with the path.json of `path`"
        raise InputError("--waypoints", waypoints, allowed) from None


def _text(answer: Recovery, above: Mapping[str, object]) -> str:
    """Return an answer in lines, after others that stand above it."""
    shown: dict[str, object] = {**above, "answer": answer.verdict}
    shown |= {f"tried {k}": sentence for k, sentence in enumerate(answer.tried, start=1)}
    run, advice = answer.trajectory, answer.help
    if run is not None:
        shown |= {
            **run.summary(),
            "ends at (rad or m)": dict(
                zip(run.joints, run.positions[-1].tolist(), strict=True)
            ),
        }
    if answer.closest is not None:
        shown["closest links"] = str(answer.closest)
    if advice is not None:
        if advice.share:
            shown["share of the path done"] = f"{100 * advice.share:.0f} %"
        shown |= {
            "nearest (m)": advice.nearest.distance,
            "nearest (rad)": advice.nearest.angle,
            "nearest q (rad or m)": dict(advice.nearest.q),
        }
        for name, places in advice.brake.items():
            shown[f"{name} could have locked at (rad or m)"] = [
                round(x, _DECIMALS) for x in places
            ] or "nowhere"
    return as_text(shown)
