"""How the answer depends on the characteristic length, at one configuration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from formulations import measures
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray

# Lengths shown, as multiples of the one in use: a decade either way, in quarter decades.
_SHOWN = tuple(10 ** (k / 4) for k in range(-4, 5))
# Lengths among which the best is sought: two decades either way.
_DECADES = 2.0
_GRID = 161


@dataclass(frozen=True)
class AtLength:
    """What one characteristic length makes of a configuration.

    Attributes
    ----------
    length
        ℓ in metres.
    worst_case_sigma
        Eq. (5) of J in units of ℓ.
    percent_of_bound
        That, in percent of the bound (6) at the same ‖J‖_F.
    worst_case_joints
        Names of the joints whose failure it is.
    """

    length: float
    worst_case_sigma: float
    percent_of_bound: float
    worst_case_joints: tuple[str, ...]


def at_length(arm: RobotArm, configuration: FloatArray, length: float, locked: int) -> AtLength:
    """Measure a configuration at one characteristic length."""
    matrix = arm.jacobian_at_length(configuration, length)
    worst = measures.worst_case(matrix, locked)
    bound = measures.sigma_bound(*arm.shape, measures.trace(matrix))
    return AtLength(
        length=length,
        worst_case_sigma=worst.sigma,
        percent_of_bound=100.0 - measures.gap_percent(worst.sigma, bound),
        worst_case_joints=tuple(arm.chain.names[k] for k in worst.joints),
    )


def sweep(arm: RobotArm, configuration: FloatArray, locked: int = 1) -> tuple[AtLength, ...]:
    """Measure a configuration at lengths a decade about the one in use; none if it is a
    mere unit.
    """  # noqa: D205
    if not arm.depends_on_length:
        return ()
    middle = arm.length_at(configuration)
    return tuple(at_length(arm, configuration, middle * k, locked) for k in _SHOWN)


def best_length(arm: RobotArm, configuration: FloatArray, locked: int = 1) -> AtLength | None:
    """Return the length with the largest percentage of the bound, two decades about the one
    in use; None if ℓ is a mere unit or no length gives more than 0.
    """  # noqa: D205
    if not arm.depends_on_length:
        return None
    middle = np.log10(arm.length_at(configuration))

    def loss(exponent: float) -> float:
        return -at_length(arm, configuration, 10**exponent, locked).percent_of_bound

    grid = np.linspace(middle - _DECADES, middle + _DECADES, _GRID)
    best = int(np.argmin([loss(exponent) for exponent in grid]))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
    found = minimize_scalar(loss, bounds=(low, high), method="bounded", options={"xatol": 1e-9})
    exponent = min((float(found.x), float(grid[best])), key=loss)
    answer = at_length(arm, configuration, 10**exponent, locked)
    return answer if answer.percent_of_bound > 1e-9 else None
