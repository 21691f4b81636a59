"""What joints of a robot's number and kind can reach at all, if they are free to be placed."""

from __future__ import annotations

from formulations import measures
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray

#: Best known worst case of seven revolute joints in six dimensions, ‖J‖_F² = 14: lever arms
#: of mean square 1, max-min (results/comparison). The bound (6) there is 0.57735.
BEST_7R = 0.574648935
_TRACE_7R = 14.0


def best_7r(arm: RobotArm, jacobian: FloatArray) -> float | None:
    """Return the best known worst case of any 7R of the same ‖J‖_F; None for other arms.

    It is `BEST_7R`·√(‖J‖_F²/14). At the default characteristic length ‖J‖_F² is 14, and
    the arm is one of those that `BEST_7R` is the best of. At any other the best 7R of the
    same ‖J‖_F is poorer still: 0.5712·√(‖J‖_F²/14) at root mean square lever arm 0.9ℓ,
    0.5715·√(‖J‖_F²/14) at 1.1ℓ. Arms in which joints mimic others are not counted as 7R.
    """
    followed = len(arm.chain.motions) > len(arm.chain.joints)
    if arm.shape != (6, 7) or any(arm.chain.prismatic) or followed:
        return None
    return BEST_7R * float((measures.trace(jacobian) / _TRACE_7R) ** 0.5)


def reachable_sigma(arm: RobotArm, jacobian: FloatArray) -> float:
    """Return the best that could be reached with this number of joints and this ‖J‖_F.

    For 7R in six dimensions that is `best_7r`; for any other arm the bound (6). Positional
    arms, and revolute joints in six dimensions from eight on, do reach the bound; where
    prismatic joints or unusual directions are involved it may be out of reach.
    """
    best = best_7r(arm, jacobian)
    if best is not None:
        return best
    return measures.sigma_bound(*arm.shape, measures.trace(jacobian))
