"""Failures of arms that exist, drawn by a seed: what `recovery.py` runs, and others may.

A task is an object of JSON:

========= ===============================================================================
id        number of the task in its half, from 0
kind      a kind of failures and a kind of goal, a pair of `KINDS`
arm       a name of `results/robots/survey.csv`, which has the file, base and tip
failures  objects: kind (locked, range, speed), joint, and at; lower, upper; or share
start     where the arm is: by joint, radians or metres
goal      position in metres and, if it counts, quaternion (scalar last), in the base's axes;
          a list of two such for a path, straight, from the first to the second
obstacles boxes: position of the middle, and edges along the base's axes, metres; where there
          are some, links may not touch them, nor each other
========= ===============================================================================

Starts and goals are drawn uniformly within the limits of the whole arm, and where there are
obstacles among the configurations that are free: every pose was within its reach before the
failure. A joint locks where it is at the start. Numbers are rounded to nine decimals.
"""

import json
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.clearance.read_clearance import Obstacles, read_clearance
from lockedjoint.clearance.shapes import Shape
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.pose import Pose
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.recovery.failures import Damage, Locked, ReducedRange, ReducedSpeed
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.robot import Robot
from results.robots.survey import ARMS, SurveyArm

#: Ten arms of seven joints, from two packages.
NAMES = (
    "Franka Panda",
    "KUKA LBR iiwa 14",
    "UFactory xArm7",
    "Baxter, left arm",
    "Alex, left arm",
    "Talos, left arm",
    "TIAGo, arm",
    "PR2, right arm",
    "Unitree G1, left arm",
    "iCub, left arm",
)
FAILURES = ("one locked", "two locked", "reduced range", "reduced speed")
GOALS = ("position", "pose", "path")
_AMONG = "position among obstacles"
#: Kinds of failures and of goals.
KINDS = (*product(FAILURES, GOALS), ("one locked", _AMONG))
# The class that states a failure, by the word in a task.
_FAILED = {"locked": Locked, "range": ReducedRange, "speed": ReducedSpeed}
# Share of its range that a joint with a reduced range keeps.
_RANGE_LEFT = 0.3
# Least share of its speed that a joint with a reduced speed keeps.
_LEAST_SPEED_LEFT = 0.1
# Largest share of its speed that such a joint keeps.
_MOST_SPEED_LEFT = 0.5
# Length of paths: longer ones can be finished more rarely.
_PATH_M = 0.15
# Number of boxes about an arm. More and larger ones make the tasks harder.
_BOXES = 3
# Shortest and longest edge of a box, as shares of the arm's reach.
_EDGES = (0.1, 0.3)
# Smallest and largest distance of a box from the base, as shares of the arm's reach.
_PLACES = (0.4, 0.9)
# Boxes are drawn anew so often, if a link touches one wherever it is; then this is an error.
_TRIES = 100
# Number of decimals of all numbers in a task.
_DECIMALS = 9


def arm_named(name: str) -> SurveyArm:
    """Return an arm of the survey, with all six task directions."""
    return next(arm for arm in ARMS if arm.name == name and arm.task == "all")


def draw(per_arm: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield so many tasks of each arm, kind of failures and kind of goal."""
    rng = np.random.default_rng(seed)
    number = 0
    for name in NAMES:
        chain = arm_named(name).arm().chain
        obstacles, free = _scene(name, chain, rng)
        for failure, goal in KINDS:
            among = goal == _AMONG
            for _ in range(per_arm):
                start, end = (free() if among else _sample(chain, rng) for _ in range(2))
                task = {
                    "id": number,
                    "arm": name,
                    "kind": [failure, goal],
                    "failures": list(_failures(failure, chain, start, rng)),
                    "start": dict(zip(chain.names, start.tolist(), strict=True)),
                    "goal": _goal(goal, chain, end, rng),
                    "obstacles": obstacles if among else [],
                }
                yield json.loads(json.dumps(task), parse_float=_rounded)
                number += 1


def _scene(
    name: str, chain: Chain, rng: np.random.Generator
) -> tuple[list[dict[str, Any]], Callable[[], FloatArray]]:
    """Return boxes about an arm, and what draws configurations, (n,), that are free of them."""
    reach = chain.normal_form.reach
    for trial in range(_TRIES):
        boxes = [_box(reach, rng) for _ in range(_BOXES)]
        try:
            clearance = _clearance(name, chain, json.dumps(boxes))
            break
        except InputError:  # a link touches a box wherever it is
            if trial == _TRIES - 1:
                raise

    def free() -> FloatArray:
        while True:
            q = _sample(chain, rng)
            if clearance.is_kept(q[:, None])[0]:
                return q

    return boxes, free


def _box(reach: float, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a box in a random direction from the base: ``position`` and ``edges``, metres."""
    way = rng.normal(size=3)
    place = rng.uniform(*_PLACES) * reach * way / np.linalg.norm(way)
    edges = rng.uniform(*_EDGES, 3) * reach
    return {"position": place.tolist(), "edges": edges.tolist()}


@lru_cache(maxsize=2)
def _clearance(name: str, chain: Chain, boxes: str) -> LinkClearance:
    """Return what must not touch: links of an arm, and boxes in the axes of its base."""
    bodies = []
    for k, box in enumerate(json.loads(boxes)):
        pose = np.eye(4)
        pose[:3, 3] = box["position"]
        bodies.append((f"box {k}", (Shape("box", tuple(box["edges"]), None, np.eye(4)),), pose))
    return read_clearance(arm_named(name).path, chain, 0.0, Obstacles(tuple(bodies)))


def stated(
    task: dict[str, Any],
) -> tuple[Damage, list[float], ToolGoal | ToolPath, LinkClearance | None]:
    """Return the arm of a task, where it is, its goal, and what must not touch.

    The arm has its failures. Where it is: radians or metres of each joint of the healthy arm.
    What must not touch is None where there are no obstacles.
    """
    failures = [
        _FAILED[each["kind"]](**{key: value for key, value in each.items() if key != "kind"})
        for each in task["failures"]
    ]
    goal: ToolGoal | ToolPath
    if isinstance(task["goal"], list):
        places = np.array([each["position"] for each in task["goal"]])
        goal = ToolPath(places, np.array([each["quaternion"] for each in task["goal"]]))
    else:
        turn = task["goal"].get("quaternion")
        goal = ToolGoal(Pose(tuple(task["goal"]["position"]), turn and tuple(turn)))
    arm = arm_named(task["arm"])
    robot = Robot(arm.path, tip=arm.tip, base=arm.base or None)
    left = Damage.of(robot, failures)
    boxes = task["obstacles"]
    clearance = _clearance(arm.name, left.chain, json.dumps(boxes)) if boxes else None
    return left, list(task["start"].values()), goal, clearance


def _rounded(number: str) -> float:
    """Return a number of JSON, rounded."""
    return round(float(number), _DECIMALS)


def _sample(chain: Chain, rng: np.random.Generator) -> FloatArray:
    """Draw a configuration within the limits, (n,), radians or metres."""
    least, largest = chain.ranges
    return np.asarray(rng.uniform(least[:, 0], largest[:, 0]))


def _failures(
    kind: str, chain: Chain, start: FloatArray, rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    """Draw the failures of a task: dictionaries as the header says, at a configuration (n,)."""
    least, largest = chain.ranges
    for k in rng.choice(len(start), 2 if kind == "two locked" else 1, replace=False).tolist():
        name, at = chain.names[k], float(start[k])
        if kind == "reduced range":
            width = _RANGE_LEFT * float(largest[k, 0] - least[k, 0])
            lower = max(float(least[k, 0]), at - width * float(rng.uniform()))
            upper = min(float(largest[k, 0]), lower + width)
            yield {"kind": "range", "joint": name, "lower": lower, "upper": upper}
        elif kind == "reduced speed":
            share = float(rng.uniform(_LEAST_SPEED_LEFT, _MOST_SPEED_LEFT))
            yield {"kind": "speed", "joint": name, "share": share}
        else:
            yield {"kind": "locked", "joint": name, "at": at}


def _goal(kind: str, chain: Chain, q: FloatArray, rng: np.random.Generator) -> Any:
    """Return the goal of a task: where the tool is at a configuration, or a path from there."""
    position, rotation = chain.tip_at(q[:, None])
    place = position[:, 0].tolist()
    if kind not in ("pose", "path"):
        return {"position": place}
    turn = Rotation.from_matrix(rotation[:, :, 0]).as_quat().tolist()
    pose = {"position": place, "quaternion": turn}
    if kind == "pose":
        return pose
    way = rng.normal(size=3)
    end = position[:, 0] + _PATH_M * way / np.linalg.norm(way)
    return [pose, {"position": end.tolist(), "quaternion": turn}]
