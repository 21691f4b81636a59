"""What recovers arms that exist from failures, and what is known to be impossible.

What comes in: nothing but the seeds; `tasks` draws the tasks, objects of JSON whose keys its
header lists. What goes out: ``tasks_tuning.json`` and ``tasks_held_back.json``, the tasks;
``answers.csv``, a line for each task and method: half, id of the task, method, answer (solved,
proved or numerical if it is impossible, or unknown) and processor time in seconds;
``recovery.csv``, a `RecoveryRow` for each kind of failures and of goal.

Others do the same tasks: *pink* goes from where the arm is towards the goal, by quadratic
programs on pinocchio's model with what has locked fixed and ranges reduced. It knows no
obstacles: where it touches some, it has failed. *RRT-Connect* takes the inverse solution that a
single start, where the arm is, leads to, and plans to it by OMPL.
"""

import json
import logging
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise, starmap
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from lockedjoint.formulations.io.files import write_text
from lockedjoint.formulations.io.table import HIDDEN, column
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.paths.connecting import Connector, SearchLimit
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.recovery.along_path import recover_path
from lockedjoint.recovery.configurations import GoalSearch
from lockedjoint.recovery.damaged_state import DamagedState
from lockedjoint.recovery.failures import Damage
from lockedjoint.recovery.recover import recovered
from lockedjoint.recovery.recovery_search import RecoverySearch
from results.recovery.tasks import KINDS, NAMES, arm_named, draw, stated
from results.script import main, study_of

#: The halves of the tasks, by their seeds; the one held back is for the end.
HALVES = {"tuning": 12345, "held back": 54321}
# The number of tasks of each arm, kind of failures and of goal, in a half. The time that the
# study takes grows with it.
_EACH = 39
# The length of a step of pink, in seconds. Velocities are limited: shorter steps need more of
# them to a goal.
_STEP_S = 0.05
# The number of steps that pink may make to a goal: fewer let it fail more often.
_STEPS = 400
# The damping of pink's quadratic programs: larger values keep joints from moving fast near
# singularities.
_PINK_DAMPING = 1e-9
# The largest velocity of a joint that has no limit or a higher one, in rad/s or m/s.
_FASTEST = 1e3
# The number of poses of a path that pink follows. Fewer of them let it leave the path between
# two poses without being noticed.
_SAMPLES = 30
# Each of the six parts of the error, metres and radians, is below this where pink has reached
# a goal.
_NEAR_M_OR_RAD = 1e-3
# The time that RRT-Connect gets for one task: with less of it more tasks are unknown.
_RRT_LIMIT = SearchLimit(seconds=5.0)
# The seed of RRT-Connect, and of the random start of inverse kinematics before it.
_RRT_SEED = 0


@dataclass(frozen=True)
class RecoveryRow:
    """Tasks with failures and goals of a kind, of both halves: the columns of ``recovery.csv``.

    By `recover` solved with a trajectory, impossible, proved or numerical, or unknown. The
    share is of those that are not known to be impossible. Seconds are of the processor, of one
    task.
    """

    failures: str
    goal: str
    tasks: int
    solved: int
    proved: int = field(metadata=column("proved impossible"))
    numerical: int = field(metadata=column("impossible, numerical"))
    unknown: int
    share: float = field(metadata=column("% of what may be possible", ".0f"))
    median_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    largest_seconds: float = field(metadata=column("largest (s)", ".1f"))
    one_solution: int = field(metadata=column("RRT-Connect to one solution"))
    one_solution_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    pink: int
    pink_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    held_back_solved: int = field(metadata=HIDDEN)
    held_back_impossible: int = field(metadata=HIDDEN)
    held_back_unknown: int = field(metadata=HIDDEN)
    arms: int = field(metadata=HIDDEN)


def _ours(task: dict[str, Any]) -> str:
    """Say what `recover` finds: solved, proved or numerical (impossible), or unknown."""
    arm, start, goal, clearance = stated(task)
    state = DamagedState.of(arm, start, clearance=clearance)
    return _WORDS[recovered(state, goal).verdict]


def by_one_solution(task: dict[str, Any]) -> str:
    """Say whether RRT-Connect gets to the inverse solution of one start, or along the path.

    The answer is solved or unknown.
    """
    arm, start, goal, clearance = stated(task)
    search = RecoverySearch(starts=1, boxes=1)
    state = DamagedState.of(arm, start, clearance=clearance, search=search)
    if isinstance(goal, ToolPath):
        return "solved" if recover_path(state, goal).trajectory else "unknown"
    ends = GoalSearch(arm, goal, state.start).at_goal(1, np.random.default_rng(_RRT_SEED))
    ends = np.array([end for end in ends if state.connector.is_free(end)])
    if not len(ends):
        return "unknown"
    way = state.connector.rrt_connect(state.start, ends, _RRT_LIMIT, _RRT_SEED)
    return "unknown" if way is None else "solved"


def by_pink(task: dict[str, Any]) -> str:
    """Say whether pink's inverse kinematics gets to the goal, or along the path.

    The answer is solved or unknown.
    """
    import pink

    logging.getLogger().addFilter(_without_limits)
    arm, start, goal, clearance = stated(task)
    model, q = _model(task["arm"], arm, start)
    configuration = pink.Configuration(model, model.createData(), q)
    base = configuration.get_transform_frame_to_world(arm.chain.base or "universe")
    if isinstance(goal, ToolPath):
        poses = goal.sampled(_SAMPLES, 1.0)[1]
        targets = list(starmap(pin.SE3, zip(poses.rotations, poses.positions, strict=True)))
        oriented = True
    else:
        targets = [pin.SE3(goal.pose.rotation, goal.position)]
        oriented = goal.pose.quaternion is not None
    own = pink.tasks.FrameTask(
        arm.chain.tip, position_cost=1.0, orientation_cost=1.0 if oriented else 0.0
    )
    rows = slice(0, 6 if oriented else 3)
    moving = [model.joints[model.getJointId(name)].idx_v for name in arm.chain.names]
    way = [np.array(start)[arm.free]]
    for target in targets:
        own.set_target(base * target)
        for _ in range(_STEPS):
            if np.max(np.abs(own.compute_error(configuration)[rows])) < _NEAR_M_OR_RAD:
                break
            velocity = pink.solve_ik(
                configuration, [own], _STEP_S, "daqp", damping=_PINK_DAMPING, safety_break=False
            )
            configuration.integrate_inplace(velocity, _STEP_S)
            way.append(way[-1] + _STEP_S * velocity[moving])
        else:
            return "unknown"
    free = all(starmap(Connector(arm.chain, clearance).is_line_free, pairwise(way)))
    return "solved" if free else "unknown"


def _without_limits(record: logging.LogRecord) -> bool:
    """Leave out what pink says, by the root logger, of each step that ends at a limit."""
    return "is out of limits" not in str(record.msg)


def _model(name: str, arm: Damage, start: list[float]) -> tuple[Any, Any]:
    """Return pinocchio's model of what can move, and its configuration at the start, (nq,).

    `start` is where each joint of the healthy arm is, in radians or metres.
    """
    whole, places = _whole(name), dict(zip(arm.healthy.names, start, strict=True))
    fixed = [k for k, joint in enumerate(whole.names) if k and joint not in arm.chain.names]
    model = pin.buildReducedModel(whole, fixed, _configuration(whole, places))
    for joint in arm.chain.joints:
        own = model.joints[model.getJointId(joint.name)]
        if own.nq == 1:  # of joints that turn without limits pinocchio has cosine and sine
            model.lowerPositionLimit[own.idx_q] = joint.lower
            model.upperPositionLimit[own.idx_q] = joint.upper
            model.velocityLimit[own.idx_v] = min(joint.velocity, _FASTEST)
    return model, _configuration(model, places)


@lru_cache(maxsize=4)
def _whole(name: str) -> Any:
    """Return pinocchio's model of a whole robot, by the name of its arm."""
    return pin.buildModelFromUrdf(str(arm_named(name).path))


def _configuration(model: Any, places: dict[str, float]) -> Any:
    """Return a configuration, (nq,), from radians or metres by joint; others are neutral."""
    move = np.zeros(model.nv)
    for name in places.keys() & set(model.names):
        move[model.joints[model.getJointId(name)].idx_v] = places[name]
    return pin.integrate(model, pin.neutral(model), move)


# The answers that verdicts of `recover` count as.
_WORDS = {
    "trajectory": "solved",
    "impossible, proved": "proved",
    "impossible, numerical": "numerical",
    "not found": "unknown",
}
#: The methods that are compared: each says what comes of a task. The order is that of `_row`.
METHODS = {"recover": _ours, "RRT-Connect to one solution": by_one_solution, "pink": by_pink}
# Half, number of the task, method, answer and seconds.
_Answer: TypeAlias = tuple[str, int, str, str, float]


def compute(effort: Effort, folder: Path) -> Iterator[RecoveryRow]:
    """Yield a row for each kind of failures and kind of goal; write the tasks and answers."""
    tasks = {}
    for half, seed in HALVES.items():
        tasks[half] = list(draw(effort.starts or _EACH, seed + effort.seed))
        lines = ",\n".join(json.dumps(task) for task in tasks[half])
        write_text(folder / f"tasks_{half.replace(' ', '_')}.json", f"[\n{lines}\n]\n")
    lines = "half,id,method,answer,seconds\n"
    for kind in KINDS:
        effort.progress(" and ".join(kind))
        answers = [
            _answered(half, task, method)
            for half, own in tasks.items()
            for task in own
            if tuple(task["kind"]) == kind
            for method in METHODS
        ]
        lines += "".join(",".join(map(str, answer)) + "\n" for answer in answers)
        write_text(folder / "answers.csv", lines)
        yield _row(*kind, answers)


def _answered(half: str, task: dict[str, Any], method: str) -> _Answer:
    """Return a method's answer to a task of a half, with its processor time in seconds."""
    started = time.process_time()
    answer = METHODS[method](task)
    return half, task["id"], method, answer, round(time.process_time() - started, 3)


def _row(failures: str, goal: str, answers: list[_Answer]) -> RecoveryRow:
    """Return the row of all answers, of both halves, to tasks of one kind."""
    ours, others, pink = (
        [answer for answer in answers if answer[2] == method] for method in METHODS
    )
    words = [answer[3] for answer in ours]
    held_back = [answer[3] for answer in ours if answer[0] == "held back"]
    impossible = [part.count("proved") + part.count("numerical") for part in (words, held_back)]
    possible = len(words) - impossible[0]
    counts: dict[str, Any] = {word: words.count(word) for word in _WORDS.values()}
    return RecoveryRow(
        failures,
        goal,
        len(ours),
        **counts,
        share=100 * words.count("solved") / possible if possible else np.nan,
        median_seconds=_median(ours),
        largest_seconds=max(answer[4] for answer in ours),
        one_solution=sum(answer[3] == "solved" for answer in others),
        one_solution_seconds=_median(others),
        pink=sum(answer[3] == "solved" for answer in pink),
        pink_seconds=_median(pink),
        held_back_solved=held_back.count("solved"),
        held_back_impossible=impossible[1],
        held_back_unknown=held_back.count("unknown"),
        arms=len(NAMES),
    )


def _median(answers: list[_Answer]) -> float:
    """Return the median processor time of the answers, in seconds."""
    return float(np.median([answer[4] for answer in answers]))


STUDY = study_of(
    __file__,
    compute,
    RecoveryRow,
    title="recoveries from failures, and what is impossible",
    takes="an hour and a half, and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
