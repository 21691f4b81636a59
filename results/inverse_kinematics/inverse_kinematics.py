"""How often inverse kinematics reaches goals within limits, by two kinds of steps.

Goals are where an arm is at random configurations within its limits, so each can be reached;
starts are random too. Arms are whole, or one joint is locked, or keeps 30 % of its range.
Nothing of the library was tuned to these goals: `--seed` draws others.

Here n is the number of joints that can move, B the number of starts of one goal, each a column;
configurations q have shape (n, B), in radians or metres, and limits (n, 1).
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.formulations.io.table import column
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.bounded_step import least_squares
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.kinematics.pose import Pose
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.recovery.failures import Damage, Locked, ReducedRange
from lockedjoint.recovery.goal import REACHED, GoalResidual, ToolGoal
from lockedjoint.robot import Robot
from results.robots.survey import ARMS, SurveyArm
from results.script import main, study_of

#: States of an arm, and kinds of goals: a place of the tool, or also how it is turned.
STATES = ("whole", "one locked", "reduced range")
GOALS = ("position", "pose")
_SURVEY = [arm for arm in ARMS if arm.package == "example-robot-data" and arm.task == "all"]
# The number of goals of each arm, state and kind. More of them make percentages more certain,
# and the study longer.
_EACH = 12
# The number of random starts of each goal, unless `--starts` says otherwise. With more of them
# fewer goals are missed.
_STARTS = 20
# Share of its range that a joint with a reduced range keeps.
_LEFT = 0.3
# The largest number of steps from a start. With fewer of them fewer starts reach their goals.
_STEPS = 60
# The longest move of a joint in one step of `cut_off`, radians or metres. A longer one leaves
# the range in which the Jacobian describes the arm well; a shorter one needs more steps.
_LONGEST_RAD_OR_M = 0.5
# The damping of a step of `cut_off` is the first number plus the second times |error|², which
# counts at most 1. The first keeps the linear system regular at the goal; with a larger second
# one steps far from the goal are shorter, and fewer of them lead astray.
_LEAST_DAMPING = 1e-10
_DAMPING_PER_SQUARE = 0.01

# The pair that a step function returns: configurations at which starts end, shape (n, B), and
# which of them are at the goal, shape (B,).
_Ends: TypeAlias = tuple[FloatArray, BoolArray]


@dataclass(frozen=True)
class StepRow:
    """One state of the arms, kind of goal and kind of step: the columns of the table.

    A goal is missed if none of its starts reaches it. Times are of the processor: of all
    starts, divided by the starts, and by those that reach their goal.
    """

    state: str = field(metadata=column("arm"))
    goal: str
    step: str
    goals: int
    starts: int
    percent: float = field(metadata=column("% of starts at the goal", ".1f"))
    missed: int = field(metadata=column("goals missed"))
    milliseconds: float = field(metadata=column("CPU ms per start", ".3f"))
    per_success: float = field(metadata=column("CPU ms per success", ".3f"))


def cut_off(
    residual: GoalResidual, q: FloatArray, lower: FloatArray, upper: FloatArray
) -> _Ends:
    """Move configurations by steps of all joints, which are cut off at the limits.

    The step of this library before `bounded_step`: with the error e and its Jacobian J, each
    step is the damped least-squares solution of J·move = e. A joint that is pushed against its
    limit stays in J, so others do not make up for it. `q` itself is not changed.
    """
    q = q.copy()
    reached, going = np.zeros(q.shape[1], dtype=bool), np.arange(q.shape[1])
    for k in range(_STEPS):
        missing, matrix = residual(going, q[:, going])
        square = np.sum(missing**2, axis=0)
        away = square >= REACHED**2
        reached[going[~away]] = True
        going = going[away]
        if not going.size or k == _STEPS - 1:
            break
        damping = _LEAST_DAMPING + _DAMPING_PER_SQUARE * np.minimum(square[away], 1.0)
        move = least_squares(matrix[:, :, away], missing[:, away], damping)
        move = np.clip(move, -_LONGEST_RAD_OR_M, _LONGEST_RAD_OR_M)
        q[:, going] = np.clip(q[:, going] + move, lower, upper)
    return q, reached


def bounded(
    residual: GoalResidual, q: FloatArray, lower: FloatArray, upper: FloatArray
) -> _Ends:
    """Move configurations as the library does: a joint at its limit is taken out."""
    return residual.solved(q, lower, upper, steps=_STEPS)


STEPS: dict[str, Callable[[GoalResidual, FloatArray, FloatArray, FloatArray], _Ends]] = {
    "cut off": cut_off,
    "bounded": bounded,
}


def compute(effort: Effort, folder: Path) -> Iterator[StepRow]:  # noqa: ARG001
    """Yield a row for each state, kind of goal and kind of step."""
    starts = effort.starts or _STARTS
    for state, goal in product(STATES, GOALS):
        effort.progress(f"{state}, {goal}")
        rng = np.random.default_rng([effort.seed, STATES.index(state), GOALS.index(goal)])
        drawn = [one for arm in _SURVEY for one in _drawn(arm, state, goal, starts, rng)]
        yield from (_row(state, goal, step, drawn) for step in STEPS)


def _drawn(
    arm: SurveyArm, state: str, goal: str, starts: int, rng: np.random.Generator
) -> Iterator[tuple[GoalResidual, FloatArray]]:
    """Yield pairs: the error from a goal of this arm, and random starts, shape (n, starts).

    The goal is where the tool is at a random configuration of the damaged arm.
    """
    robot = Robot(arm.path, tip=arm.tip, base=arm.base or None)
    for _ in range(_EACH):
        chain = _damaged(robot, state, rng)
        least, largest = chain.ranges
        q = rng.uniform(least, largest)
        position, rotation = chain.tip_at(q)
        quaternion = Rotation.from_matrix(rotation[:, :, 0]).as_quat().tolist()
        pose = Pose(tuple(position[:, 0].tolist()), quaternion if goal == "pose" else None)
        own = rng.uniform(least, largest, (len(least), starts))
        yield GoalResidual(ToolGoal(pose), chain), own


def _damaged(robot: Robot, state: str, rng: np.random.Generator) -> Chain:
    """Return the chain of what can still move, after a failure within the limits.

    One random joint fails at a random place of its range: it is locked there, or keeps a range
    of `_LEFT` times the width, which begins there or as far up as it fits.
    """
    chain = robot.arm.chain
    if state == "whole":
        return chain
    least, largest = (side[:, 0] for side in chain.ranges)
    joint = int(rng.integers(len(least)))
    at, name = float(rng.uniform(least[joint], largest[joint])), chain.names[joint]
    if state == "one locked":
        return Damage.of(robot, [Locked(name, at)]).chain
    width = _LEFT * float(largest[joint] - least[joint])
    lower = min(at, float(largest[joint]) - width)
    return Damage.of(robot, [ReducedRange(name, lower, lower + width)]).chain


def _row(
    state: str, goal: str, step: str, drawn: list[tuple[GoalResidual, FloatArray]]
) -> StepRow:
    """Return how often one kind of step reaches the goals that were drawn, and its time."""
    began = time.process_time()
    ends = (STEPS[step](one, q, one.chain.lower, one.chain.upper) for one, q in drawn)
    shares = np.array([np.mean(reached) for _, reached in ends])
    seconds = time.process_time() - began
    starts = sum(q.shape[1] for _, q in drawn)
    return StepRow(
        state,
        goal,
        step,
        goals=len(drawn),
        starts=starts,
        percent=float(100 * np.mean(shares)),
        missed=int(np.sum(shares == 0)),
        milliseconds=1e3 * seconds / starts,
        per_success=1e3 * seconds / (starts * float(np.mean(shares))),
    )


STUDY = study_of(
    __file__,
    compute,
    StepRow,
    title="inverse kinematics within limits, by two kinds of steps",
    takes="five minutes, and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
