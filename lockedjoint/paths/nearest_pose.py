"""How near a tool comes to a pose that is out of reach, as far as inverse kinematics finds."""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.kinematics.tool_poses import ToolPoses

# Inverse kinematics has so many random starts: the best of 200 came as near as local search
# from 30 starts to 1 %, on two poses that an arm of seven joints does not reach.
_STARTS = 200
# Inverse kinematics moves so often: at the nearest pose its steps become short.
_ITERATIONS = 60


def nearest_pose(chain: Chain, pose: ToolPoses, rng: np.random.Generator) -> str:
    """Say where the tool is at the nearest pose that was found, and how far that is.

    The nearest has the least squared distance, in metres and radians, in the directions that
    count; their linear and angular parts are said one by one.
    """
    least, largest = chain.ranges
    starts = rng.uniform(least, largest, (len(least), _STARTS))
    q, _ = solve_ik(chain, starts, pose, iterations=_ITERATIONS)
    position, rotation = chain.tip_at(q)
    missing = pose.missing(position, rotation)
    best = int(np.argmin(np.sum(missing**2, axis=0)))
    linear = np.array([row < 3 for row in pose.rows])
    parts = []
    if linear.any():
        parts.append(f"{np.linalg.norm(missing[linear, best]):.3g} m")
    if not linear.all():
        parts.append(f"{np.degrees(np.linalg.norm(missing[~linear, best])):.3g}°")
    place = ", ".join(f"{x:.4g}" for x in position[:, best])
    return f"({place}) m, {' and '.join(parts)} away"
