"""``lockedjoint recover``: reach the goal after a failure, or know that it is impossible."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lockedjoint.commands.arguments import Seed, by_joint, option, separated
from lockedjoint.commands.output import UNSUCCESSFUL, Answer, as_text
from lockedjoint.commands.robot_arguments import (
    ClearanceOptions,
    LinkOptions,
    pairs,
    ranges,
    read_configuration,
    read_near_pose,
)
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.paths.waypoints import ToolPath
    from lockedjoint.recovery.answers import Recovery
    from lockedjoint.recovery.failures import Failure
    from lockedjoint.recovery.goal import ToolGoal

_PROOF = "proof.json"


@dataclass(frozen=True)
class FailedOptions:
    """What has failed."""

    locked: list[str] | None = option(
        "JOINT[=VALUE]",
        "A joint that has locked, and where, in radians or metres; by default where --at has"
        " it. May be repeated.",
    )
    reduced_range: list[str] | None = option(
        "JOINT=LOWER:UPPER", "A joint that is left a smaller range. May be repeated."
    )
    reduced_speed: list[str] | None = option(
        "JOINT=SHARE", "A joint that is left a share of its speed. May be repeated."
    )
    free_swinging: str | None = option(
        "JOINT",
        "A revolute joint without torque and brake, which hangs by gravity, along -z of the "
        "root: with --goal alone, and a URDF file that has masses.",
    )

    def read(self, at: str | None, healthy: Chain) -> tuple[list[Failure], list[float]]:
        """Return the failures, and the configuration; InputError if they contradict."""
        from lockedjoint.recovery import failures as kinds

        settings, names = self.locked or [], healthy.names
        at_a_place = [text for text in settings if "=" in text and text not in names]
        places = pairs(at_a_place, "--locked", names)
        present = read_configuration(at, healthy, "--at").tolist()
        start = dict(zip(healthy.names, present, strict=True))
        if at is None or "=" in at:  # the others are midway, or where they have locked
            stated = pairs(separated(at, names) if at else [], "--at", names)
            start |= {k: v for k, v in places.items() if k in start and k not in stated}
        # Of an unknown joint: the library says so.
        there = [text for text in settings if text not in at_a_place]
        there = [text if text in names else text.strip() for text in there]
        failures: list[Failure] = [kinds.Locked(name, start.get(name, 0.0)) for name in there]
        failures += [kinds.Locked(name, value) for name, value in places.items()]
        reduced = self.reduced_range or ()
        for name, (low, high) in ranges(reduced, "--reduced-range", names).items():
            failures.append(kinds.ReducedRange(name, low, high))
        for name, share in pairs(self.reduced_speed or [], "--reduced-speed", names).items():
            failures.append(kinds.ReducedSpeed(name, share))
        if self.free_swinging is not None:
            failures.append(kinds.FreeSwinging(self.free_swinging))
        if not failures:
            allowed = "one of --locked, --reduced-range, --reduced-speed and --free-swinging"
            raise InputError("failure", "missing", allowed)
        return failures, list(start.values())


@dataclass(frozen=True)
class WantedOptions:
    """Where the tool is to be."""

    goal: str | None = option(
        "POSE",
        "Where the tip's point is to be, in the base's frame: x,y,z in metres, and for an "
        "orientation too roll,pitch,yaw in radians or qx,qy,qz,qw; or a JSON file.",
    )
    waypoints: Path | None = option(
        "FILE", "A path, or its rest, instead of --goal: a file as `path` reads it."
    )
    tolerance: str | None = option("METRES[,RADIANS]", "How far from --goal; by default 0,0.")
    task: str | None = option(
        "DIRECTIONS",
        "Directions of --goal that count: all, position, or some of vx,vy,vz,wx,wy,wz; by "
        "default all that it has.",
    )
    frame: str = option("FRAME", "Whose axes these are along: base, or tip at --goal.", "base")

    def read(self) -> ToolGoal | ToolPath:
        """Read it; InputError if it is not what is allowed."""
        from lockedjoint.kinematics.task_space import TaskSpace
        from lockedjoint.paths.waypoints import read_waypoints
        from lockedjoint.recovery.goal import ToolGoal

        if (self.goal is None) == (self.waypoints is None):
            given = "missing" if self.goal is None else "given besides --waypoints"
            raise InputError("--goal", given, "either --goal or --waypoints")
        if self.waypoints is not None:
            for name, value in (("--tolerance", self.tolerance), ("--task", self.task)):
                if value is not None:
                    raise InputError(name, value, "none with --waypoints")
            return read_waypoints(self.waypoints)
        pose = read_near_pose(str(self.goal), self.tolerance)
        directions = None if self.task is None else TaskSpace.parse(self.task, self.frame)
        return ToolGoal(pose, directions)


@dataclass(frozen=True)
class EffortOptions:
    """How much is tried, and how fast the arm may be."""

    acceleration_limits: str | None = option(
        "A,…",
        "Largest accelerations of the joints, rad/s² or m/s², or one for all; by default the "
        "largest speed is reached in half a second.",
    )
    velocity_limits: str | None = option(
        "V,…", "Largest speeds, rad/s or m/s, or one for all; by default the file's, or else 1."
    )
    starts: int = option("N", "Starts of inverse kinematics.", 1000, low=1, high=100_000)
    boxes: int = option("N", "Most boxes in a proof.", 1_000_000, low=1, high=10_000_000)
    seconds: float = option("SECONDS", "Time limit of RRT-Connect.", 5.0, positive=True)


def recover(
    robot: LinkOptions,
    *,
    at: str | None = option(
        "Q",
        "Where the arm is: one number per joint from base to tip, locked ones included, or "
        "JOINT=VALUE pairs, with commas; or a JSON file; by default midway between limits.",
    ),
    failed: FailedOptions,
    wanted: WantedOptions,
    effort: EffortOptions,
    apart: ClearanceOptions,
    seed: Seed = 0,
    out: Path | None = option(
        "DIR",
        "Write trajectory.csv, trajectory.json and trajectory.yaml, ROS's JointTrajectory, "
        "there; or proof.json, if the goal is proved to be out of reach.",
    ),
) -> Answer:
    """Reach a goal after joints have failed, or prove that no configuration does.

    The answer is one of three. A trajectory in time, which a separate routine checks. Or that
    the joints that still move cannot reach the goal, collisions not considered: proved, with
    all rounding errors bounded, or numerical. Or a list of what was tried without success.
    Exit status 1 if there is no trajectory.
    """
    from lockedjoint.formulations.io.files import prepare_file, write_text
    from lockedjoint.paths.timing import TRAJECTORY_FILES
    from lockedjoint.recovery.damaged_state import RecoverySearch
    from lockedjoint.recovery.failures import DamagedArm
    from lockedjoint.recovery.recover import recover as recover_arm

    tree, tip = robot.read()
    point, goal = robot.offset(), wanted.read()
    healthy = DamagedArm.of(tree, (), tip, robot.base, point).healthy
    failures, start = failed.read(at, healthy)
    given = {"velocity": effort.velocity_limits, "acceleration": effort.acceleration_limits}
    more: dict[str, Any] = {
        name: by_joint(text, f"--{name}-limits", len(start))
        for name, text in given.items()
        if text is not None
    }
    left = DamagedArm.of(tree, failures, tip, robot.base, point, robot.file).chain
    clearance = apart.read(robot.file, left)
    if out is not None:
        for name in (*TRAJECTORY_FILES, _PROOF):
            prepare_file(out / name, inputs=[robot.file, apart.obstacles])
    search = RecoverySearch(effort.starts, effort.boxes, effort.seconds, seed)
    more |= {"tip": tip, "base": robot.base, "point": point, "clearance": clearance}
    answer = recover_arm(robot.file, start, failures, goal, search=search, **more)
    plain = {"robot": tree.name, "tip": tip, "seed": seed, **answer.to_dict()}
    text = _text(answer)
    if out is not None:
        files = {} if answer.trajectory is None else answer.trajectory.files()
        if answer.proof is not None:
            files = {_PROOF: json.dumps(answer.proof.content) + "\n"}
        for name, content in files.items():
            write_text(out / name, content)
        if files:
            text += f"\n\nWritten to {out}: {', '.join(files)}"
    if answer.trajectory is not None:
        return Answer(plain, text)
    sentence = "The goal is out of reach of what can still move."
    if answer.verdict == "not found":
        sentence = "No trajectory was found, and no proof that there is none."
    return Answer(plain, text, failure=[sentence], status=UNSUCCESSFUL)


def _text(answer: Recovery) -> str:
    """Return an answer in lines."""
    shown: dict[str, object] = {"answer": answer.verdict}
    shown |= {f"tried {k}": sentence for k, sentence in enumerate(answer.tried, start=1)}
    run, advice = answer.trajectory, answer.help
    if run is not None:
        shown |= {
            "duration (s)": run.duration,
            "points": len(run.times),
            "ends at": dict(zip(run.joints, run.positions[-1].tolist(), strict=True)),
        }
    if advice is not None:
        if advice.share:
            shown["share of the path done"] = f"{100 * advice.share:.0f} %"
        shown |= {
            "nearest (m)": advice.nearest.distance,
            "nearest (rad)": advice.nearest.angle,
            "nearest configuration": dict(advice.nearest.configuration),
        }
        for name, places in advice.brake.items():
            shown[f"{name} could have locked at"] = [round(x, 3) for x in places] or "–"
    return as_text(shown)
