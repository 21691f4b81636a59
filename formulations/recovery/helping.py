"""What helps an operator where a goal is out of reach: the nearest pose, better brakes."""

from __future__ import annotations

import numpy as np

from formulations.kinematics.forward import Kinematics
from formulations.kinematics.inverse import damped_least_squares
from formulations.recovery.answers import Help, NearestPose
from formulations.recovery.configurations import GoalSearch
from formulations.recovery.failures import DamagedArm
from formulations.recovery.goal import REACHED, GoalResidual, ToolGoal
from nlp.arrays import FloatArray

_STARTS = 40
# Positions of a locked joint, over its range, and starts at each.
_BRAKES, _EACH, _STEPS = 19, 10, 30


def help_at(
    arm: DamagedArm,
    goal: ToolGoal,
    start: FloatArray,
    rng: np.random.Generator,
    share: float = 0.0,
) -> Help:
    """Return what can be done instead of a goal; the start is of what can move, (n,)."""
    search = GoalSearch(arm.chain, goal, start)
    q = search.nearest(_STARTS, rng)
    position, rotation, _ = search.kinematics.forward(q[:, None])
    far = goal.distances(goal.missing(position, rotation))
    whole = arm.whole(q[None])[0]
    nearest = NearestPose(
        dict(zip(arm.healthy.names, whole.tolist(), strict=True)),
        tuple(position[:, 0].tolist()),
        *(float(each[0]) for each in far),
    )
    brakes = {name: _brakes(arm, name, goal, rng) for name in arm.locked}
    return Help(nearest, brakes, share)


def _brakes(
    arm: DamagedArm, name: str, goal: ToolGoal, rng: np.random.Generator
) -> tuple[float, ...]:
    """Return where a locked joint could have locked so that the goal is within reach."""
    kinematics = Kinematics(arm.healthy)
    least, largest = kinematics.ranges
    lower, upper = (np.repeat(side, _BRAKES * _EACH, axis=1) for side in (least, largest))
    for k, joint in enumerate(arm.healthy.names):
        if joint == name:
            places = np.linspace(least[k, 0], largest[k, 0], _BRAKES)
            lower[k] = upper[k] = np.repeat(places, _EACH)
        elif joint in arm.locked:
            lower[k] = upper[k] = arm.locked[joint]
        else:
            left = arm.chain.joints[arm.chain.names.index(joint)]
            lower[k] = np.maximum(lower[k], left.lower)
            upper[k] = np.minimum(upper[k], left.upper)
    drawn = rng.uniform(lower, upper)
    _, reached = damped_least_squares(
        *(GoalResidual(goal, kinematics), drawn, lower, upper),
        reached=REACHED,
        damping=1e-10,
        steps=_STEPS,
        largest=1.0,
    )
    return tuple(places[reached.reshape(_BRAKES, _EACH).any(axis=1)].tolist())
