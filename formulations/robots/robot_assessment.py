"""How failure tolerant a robot is at one configuration."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from formulations import measures
from formulations.robots.characteristic_length import AtLength, best_length, sweep
from formulations.robots.reachable import reachable_sigma
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray

# Failures that leave the same up to this share of the largest singular value are equally bad.
_TIE = 1e-6
# A joint this close to a limit is at it; radians or metres.
_AT_LIMIT = 1e-4


@dataclass(frozen=True)
class Failure:
    """What the failure of some joints leaves.

    Attributes
    ----------
    joints
        Names of the joints that lock.
    sigma
        Smallest singular value without them.
    direction
        Direction of the tip that it is of: the one that suffers most, by direction's name.
    """

    joints: tuple[str, ...]
    sigma: float
    direction: dict[str, float]


@dataclass(frozen=True)
class RobotAssessment:
    """A robot's failure tolerance at one configuration.

    Attributes
    ----------
    robot, base, tip, task, frame, held
        What was assessed; see `Chain` and `Task`.
    configuration
        Positions by joint, radians or metres.
    at_limits
        Joints at one of their limits.
    characteristic_length
        ℓ in metres.
    locked
        How many joints lock at once.
    worst_case_sigma, worst_case_joints, worst_case_direction
        Eqs. (5) and (15), in units of ℓ.
    equally_bad
        How many failures leave as little, to `_TIE` of the largest singular value.
    sigma_bound, percent_of_bound
        The bound (6) at the same ‖J‖_F, and how much of it the worst case is.
    reachable_sigma, percent_of_reachable
        The same with what such joints are known to reach; see `reachable`.
    singular_values
        Of the whole J.
    failures
        Every set of joints that may lock, the worst first.
    by_length, best_length
        How the answer depends on ℓ; see `characteristic_length`.
    jacobian
        In units of ℓ, one row per direction of the task, one column per joint.
    """

    robot: str
    base: str
    tip: str
    task: tuple[str, ...]
    frame: str
    held: dict[str, float]
    configuration: dict[str, float]
    at_limits: tuple[str, ...]
    characteristic_length: float
    locked: int
    worst_case_sigma: float
    worst_case_joints: tuple[str, ...]
    worst_case_direction: dict[str, float]
    equally_bad: int
    sigma_bound: float
    percent_of_bound: float
    reachable_sigma: float
    percent_of_reachable: float
    singular_values: list[float]
    failures: tuple[Failure, ...]
    by_length: tuple[AtLength, ...]
    best_length: AtLength | None
    jacobian: list[list[float]]

    def to_dict(self) -> dict[str, object]:
        """Return the fields as plain values."""
        return asdict(self)


def assess(arm: RobotArm, configuration: npt.ArrayLike, locked: int = 1) -> RobotAssessment:
    """Measure a robot's failure tolerance at a configuration.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    configuration
        Positions of the free joints, radians or metres, shape (n,).
    locked
        How many joints lock at once.

    Raises
    ------
    InputError
        If the configuration is outside the joints' limits, or `locked` is out of range.
    """
    chain = arm.chain
    point = chain.within_limits(np.asarray(configuration, dtype=float))
    matrix = arm.jacobian(point)
    failures = _failures(arm, matrix, locked)
    values = measures.singular_values(matrix)
    worst = failures[0]
    bound = measures.sigma_bound(*arm.shape, measures.trace(matrix))
    best = reachable_sigma(arm, matrix)
    return RobotAssessment(
        robot=chain.robot,
        base=chain.base,
        tip=chain.tip,
        task=arm.task.directions,
        frame=arm.task.frame,
        held=dict(chain.held),
        configuration=dict(zip(chain.names, point.tolist(), strict=True)),
        at_limits=_at_limits(arm, point),
        characteristic_length=arm.length_at(point),
        locked=locked,
        worst_case_sigma=worst.sigma,
        worst_case_joints=worst.joints,
        worst_case_direction=worst.direction,
        equally_bad=sum(bool(one.sigma <= worst.sigma + _TIE * values[0]) for one in failures),
        sigma_bound=bound,
        percent_of_bound=_percent(worst.sigma, bound),
        reachable_sigma=best,
        percent_of_reachable=_percent(worst.sigma, best),
        singular_values=values.tolist(),
        failures=failures,
        by_length=sweep(arm, point, locked),
        best_length=best_length(arm, point, locked),
        jacobian=matrix.tolist(),
    )


def _failures(arm: RobotArm, matrix: FloatArray, locked: int) -> tuple[Failure, ...]:
    """Every failure, in the order of what it leaves."""
    sigmas = measures.locked_singular_values(matrix, locked)  # checks the number, too
    sets = list(combinations(range(matrix.shape[1]), locked))
    order = np.argsort(sigmas, kind="stable")
    return tuple(_failure(arm, matrix, sets[k], float(sigmas[k])) for k in order)


def _failure(
    arm: RobotArm, matrix: FloatArray, joints: tuple[int, ...], sigma: float
) -> Failure:
    vectors = np.linalg.svd(np.delete(matrix, joints, axis=1))[0]
    direction = vectors[:, -1]
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    named = dict(zip(arm.task.directions, direction.tolist(), strict=True))
    return Failure(tuple(arm.chain.names[k] for k in joints), sigma, named)


def _at_limits(arm: RobotArm, point: FloatArray) -> tuple[str, ...]:
    lower, upper = arm.bounds
    near = np.minimum(point - lower, upper - point) < _AT_LIMIT
    return tuple(name for name, is_near in zip(arm.chain.names, near, strict=True) if is_near)


def _percent(sigma: float, best: float) -> float:
    return 100.0 * sigma / best if best > 0 else 0.0
