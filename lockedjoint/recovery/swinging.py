"""Ways of an arm one of whose joints swings freely: slowly, so that it hangs all the way.

The joint has no torque and no friction; gravity acts along -z of the robot's root. While the
others move slowly, it is where it would hang if they stood: a function of their positions. So
they go in a straight line, and the joint with it. From its inertia along the trajectory comes
by what angle it would lag behind; time is stretched until that is small. The check simulates
what the joint then does, see `checking.swing`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lockedjoint.kinematics.hanging import HangingJoint
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.timing import TimedTrajectory
from lockedjoint.recovery.checking import SWING_RAD, faults
from lockedjoint.recovery.damaged_state import DamagedState
from lockedjoint.recovery.goal import ToolGoal

# A line has so many samples.
_LINE_SAMPLES = 61
# A joint turns by at most this between two samples.
_LARGEST_TURN_RAD = 0.3
# Time is stretched by at most this factor.
_MOST_STRETCHED = 100.0
# Time is stretched further by these factors, one after the other, until the simulation agrees.
_STRETCHES = (1.0, 1.5, 2.0)


def swinging_run(
    state: DamagedState,
    hanging: HangingJoint,
    goal: ToolGoal,
    ends: FloatArray,
    tried: list[str],
) -> TimedTrajectory | None:
    """Return a checked trajectory to one of configurations (K, n) at a goal, or None."""
    for end in ends:
        line = _line(hanging, state.start, end)
        try:
            state.arm.chain.within_limits(line.min(axis=0))
            state.arm.chain.within_limits(line.max(axis=0))
            run = state.run_along(line, ())
        except InputError:
            tried.append(f"a line: {hanging.name} hangs beyond its limits on it")
            continue
        rows = (run.positions, run.velocities, run.accelerations)
        points = zip(*(row[:, state.arm.free] for row in rows), strict=True)
        stretched = float(
            np.sqrt(max(1.0, 4 * max(hanging.lag(*at) for at in points) / SWING_RAD))
        )
        if (
            stretched > _MOST_STRETCHED
            or np.max(np.abs(np.diff(line, axis=0))) > _LARGEST_TURN_RAD
        ):
            tried.append(f"a line: {hanging.name} does not hang steadily on it")
            continue
        for by in (stretched * more for more in _STRETCHES):
            slow = _stretched(run, by)
            wrong = faults(state.arm, state.whole, goal, slow)
            words = ", ".join(wrong) or "it is right"
            tried.append(f"a line, {by:.1f} times as long in time: {words}")
            if not wrong:
                return slow
    return None


def _line(hanging: HangingJoint, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return configurations (N, n) along a line of the other joints."""
    line = [start]
    for share in np.linspace(0.0, 1.0, _LINE_SAMPLES)[1:]:
        here = start + share * (end - start)
        here[hanging.own] = line[-1][hanging.own]
        line.append(hanging.hung(here))
    return np.array(line)


def _stretched(run: TimedTrajectory, by: float) -> TimedTrajectory:
    """Return a trajectory that takes so many times as long."""
    times, speeds, rates = run.times * by, run.velocities / by, run.accelerations / by**2
    run = replace(run, times=times, velocities=speeds, accelerations=rates)
    jerk = None if run.jerk is None else run.jerk / by**3
    return replace(run, speed=run.speed / by, acceleration=run.acceleration / by**2, jerk=jerk)
