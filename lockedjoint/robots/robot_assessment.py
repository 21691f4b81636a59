"""How failure tolerant a robot is at one configuration, and how that depends on ℓ.

What comes in: a `RobotArm` and a configuration q, shape (n,), radians or (prismatic joints)
metres. What goes out: a `RobotAssessment`. Its numbers are of J, the arm's Jacobian with all
lengths in units of the characteristic length ℓ, m task rows by n joints. σ is the least
singular value of what is left of J when the columns of the joints that lock are taken away.
"""

from dataclasses import dataclass
from html import escape
from itertools import compress
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import max_min, measures
from lockedjoint.formulations.bounds.certified import best_known
from lockedjoint.formulations.bounds.unequal_failures import assess_failures
from lockedjoint.formulations.io.table import written
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import roll_pitch_yaw
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray, as_floats, one_blas_thread
from lockedjoint.nlp.errors import of_kind, printable
from lockedjoint.robots.by_length import AtLength, LengthScale, joints_left, percent
from lockedjoint.robots.structural import StructuralFailure, structural_failures

# Difference of what failures leave, as a share of the largest singular value of J, up to which
# they are equally bad.
_TIE_SHARE = 1e-6
# Distance from a limit up to which a joint is at it.
_AT_LIMIT_M_OR_RAD = 1e-4
# Multiples of the present ℓ for which the worst case is shown: quarter decades, one decade each
# way.
_SHOWN_MULTIPLES = np.array([10 ** (k / 4) for k in range(-4, 5)])
# ‖J‖_F² of the seven joints of `best_7r`.
_TRACE_OF_BEST_7R = 14.0
# A pose has these numbers, as waypoints and `--at` take them.
_POSE = ("x", "y", "z", "roll", "pitch", "yaw")
# Number of failures, the worst first, that a notebook shows.
_SHOWN_FAILURES = 10


@dataclass(frozen=True)
class AssessedFailure:
    """What the failure of some joints leaves."""

    joints: tuple[str, ...]  #: Names of the joints that lock.
    sigma: float  #: Smallest singular value without them.
    #: The tip moves least along a unit vector, which has this component in each task direction.
    direction: dict[str, float]


@dataclass(frozen=True)
class RobotAssessment:
    """A robot's failure tolerance at one configuration.

    Attributes
    ----------
    robot, base, tip, task, frame, locked, immobile, notes
        What was assessed: names of the robot and of the links at both ends, the directions of
        the task and their frame, positions of locked and of immobile joints by name, radians or
        metres, and sentences on what was read; see `Chain` and `TaskSpace`.
    q
        Positions by joint, radians or metres.
    at_limits
        Joints at one of their limits.
    tool
        Where the tip is, along the axes of the base, with the names that waypoints have: x, y,
        z in metres and roll, pitch, yaw in radians.
    characteristic_length
        ℓ in metres.
    failures
        How many joints lock at once.
    worst_case_sigma, worst_case_joints, worst_case_direction
        σ after the worst failure, eq. (5), in units of ℓ; names of the joints that lock in it;
        and the unit vector of the task space in which the tip then moves least, eq. (15), by
        direction.
    equally_bad
        How many failures leave as little, to `_TIE_SHARE` of the largest singular value.
    sigma_bound, percent_of_bound
        The bound (6) of any Jacobian of this shape with the same ‖J‖_F, and the worst case in
        percent of it.
    reachable_sigma, percent_of_reachable
        The same with the best worst case that such joints are known to reach.
    singular_values
        Singular values of the whole J, the largest first.
    by_failure
        Every set of joints that may lock, the worst first.
    structural
        Joints whose single failure is fatal at every posture, or nearly so; see
        `lockedjoint.robots.structural`.
    by_length, best_length
        The worst case at lengths up to a decade from ℓ; and at the length, up to two decades
        from ℓ, with the largest percentage of the bound, None if no length gives more than
        0. Empty and None if ℓ is only a unit; see `RobotArm.depends_on_length`.
    jacobian
        In units of ℓ, one row per direction of the task, one column per joint.
    """

    robot: str
    base: str
    tip: str
    task: tuple[str, ...]
    frame: str
    locked: dict[str, float]
    immobile: dict[str, float]
    notes: tuple[str, ...]
    q: dict[str, float]
    at_limits: tuple[str, ...]
    tool: dict[str, float]
    characteristic_length: float
    failures: int
    worst_case_sigma: float
    worst_case_joints: tuple[str, ...]
    worst_case_direction: dict[str, float]
    equally_bad: int
    sigma_bound: float
    percent_of_bound: float
    reachable_sigma: float
    percent_of_reachable: float
    singular_values: list[float]
    by_failure: tuple[AssessedFailure, ...]
    structural: tuple[StructuralFailure, ...]
    by_length: tuple[AtLength, ...]
    best_length: AtLength | None
    jacobian: list[list[float]]

    def __repr__(self) -> str:
        """Say in one line the worst case, and of which joint."""
        locked = printable(", ".join(self.worst_case_joints))
        bound = f"{self.percent_of_bound:.3g} % of the bound (6)"
        found = f"worst case σ = {self.worst_case_sigma:.6g} ({locked} locked), {bound}"
        return f"<RobotAssessment: {printable(self.robot)}, {found}>"

    def _repr_html_(self) -> str:
        """Return the line and what the worst failures leave, for notebooks."""
        cells = [
            [printable(", ".join(one.joints)), f"{one.sigma:.6f}"]
            for one in self.by_failure[:_SHOWN_FAILURES]
        ]
        table = written(cells, ["locked", "σ left"], "html")
        return f"<p>{escape(repr(self))}</p>{table}"


@one_blas_thread()
def measure_robot(
    arm: RobotArm,
    configuration: npt.ArrayLike,
    failures: int = 1,
    notes: tuple[str, ...] = (),
) -> RobotAssessment:
    """Measure a robot's failure tolerance at a configuration.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    configuration
        Positions of the free joints, radians or metres, shape (n,).
    failures
        How many joints lock at once.
    notes
        Sentences on how the configuration was read: they end the notes of the assessment.

    Raises
    ------
    InputError
        If the configuration is outside the joints' limits, or so many joints cannot lock.
    """
    allowed = "a RobotArm, and a configuration; a Jacobian is measured with `measure`"
    of_kind("arm", arm, RobotArm, allowed)
    chain = arm.chain
    point = chain.within_limits(as_floats("configuration", configuration))
    metric = arm.metric_jacobian(point)
    length = arm.length_of(metric)
    matrix = measures.as_jacobian(arm.in_units_of(metric, length))
    lower, upper = arm.bounds
    near = np.minimum(point - lower, upper - point) < _AT_LIMIT_M_OR_RAD
    every = _by_failure(arm, matrix, failures)
    values = measures.singular_values(matrix)
    worst = every[0]
    tied = worst.sigma + _TIE_SHARE * float(values[0])
    size = measures.trace(matrix)
    bound, best = measures.sigma_bound(*arm.shape, size), _reachable_sigma(arm, size)
    by_length: tuple[AtLength, ...] = ()
    best_length = None
    if arm.depends_on_length:
        scale = LengthScale(arm, metric, failures)
        by_length, best_length = scale.around(length * _SHOWN_MULTIPLES)
    return RobotAssessment(
        robot=chain.robot,
        base=chain.base,
        tip=chain.tip,
        task=arm.task.directions,
        frame=arm.task.frame,
        locked=dict(chain.locked_at),
        immobile=dict(chain.immobile),
        notes=(*chain.notes, *notes),
        q=dict(zip(chain.names, point.tolist(), strict=True)),
        at_limits=tuple(compress(chain.names, near)),
        tool=_tool(chain, point),
        characteristic_length=length,
        failures=failures,
        worst_case_sigma=worst.sigma,
        worst_case_joints=worst.joints,
        worst_case_direction=worst.direction,
        equally_bad=sum(failure.sigma <= tied for failure in every),
        sigma_bound=bound,
        percent_of_bound=percent(worst.sigma, bound),
        reachable_sigma=best,
        percent_of_reachable=percent(worst.sigma, best),
        singular_values=values.tolist(),
        by_failure=every,
        structural=structural_failures(arm),
        by_length=by_length,
        best_length=best_length,
        jacobian=matrix.tolist(),
    )


def measure_robot_unequal(
    arm: RobotArm, jacobian: npt.ArrayLike, failures: FailureModel, probabilities_known: bool
) -> dict[str, Any]:
    """Assess a robot's Jacobian where failures are unequal.

    Parameters
    ----------
    arm
        The arm, with n joints.
    jacobian
        J, shape (m, n), in units of ℓ.
    failures
        How likely each failure is.
    probabilities_known
        Whether the probabilities mean anything beyond their ratios.

    Returns
    -------
    dict
        The keys of `assess_failures`; joints have their names in place of numbers.
    """
    assessed = assess_failures(jacobian, failures, probabilities_known=probabilities_known)
    for key in ("never_failing_joints", "weighted_worst_joints"):
        assessed[key] = [arm.chain.names[k] for k in assessed[key]]
    return assessed


def _tool(chain: Chain, point: FloatArray) -> dict[str, float]:
    """Return where the tip is at a configuration, (n,): position and angles, by name."""
    position, turn = chain.tip_at(point[:, None])
    pose = [*position[:, 0].tolist(), *roll_pitch_yaw(turn[:, :, 0]).tolist()]
    return dict(zip(_POSE, pose, strict=True))


def best_7r() -> float:
    """Return the best known worst case of seven revolute joints in six dimensions.

    Their lever arms have mean square 1, so that ‖J‖_F² = 7·1 + 7·1 = 14. The bound (6) there is
    0.57735. NaN if the atlas has no such entry.
    """
    return best_known(max_min.NAME, "lever-revolute", 7) or float("nan")


def _reachable_sigma(arm: RobotArm, size: float) -> float:
    """Return the best that could be reached with this number of joints and ‖J‖_F², the size.

    For 7R in six dimensions that is `best_7r`·√(‖J‖_F²/14). At the default characteristic
    length ‖J‖_F² is 14, and the arm is one of those that `best_7r` is the best of. At any
    other the best 7R of the same ‖J‖_F is poorer still: 0.5712·√(‖J‖_F²/14) at root mean
    square lever arm 0.9ℓ, 0.5715·√(‖J‖_F²/14) at 1.1ℓ.

    For any other arm, and where joints mimic others, it is the bound (6). Positional arms,
    and revolute joints in six dimensions from eight on, do reach the bound; where prismatic
    joints or unusual directions are involved, it may be out of reach.
    """
    followed = len(arm.chain.motions) > len(arm.chain.joints)  # some joint mimics another
    if arm.shape != (6, 7) or any(arm.chain.prismatic) or followed:
        return measures.sigma_bound(*arm.shape, size)
    return best_7r() * float((size / _TRACE_OF_BEST_7R) ** 0.5)


def _by_failure(
    arm: RobotArm, matrix: FloatArray, failures: int
) -> tuple[AssessedFailure, ...]:
    """Return every failure, in ascending order of the singular value that it leaves.

    `matrix` is J, shape (m, n), and `failures` the number k of joints that lock at once.
    """
    sets = measures.locked_sets(matrix, failures)
    left = matrix[:, joints_left(sets, arm.size)[0]].transpose(1, 0, 2)  # (failures, m, n − k)
    lost = left.shape[2] < left.shape[1]  # too few joints are left for full rank
    sigmas = np.zeros(len(sets)) if lost else np.linalg.svd(left, compute_uv=False)[:, -1]
    # The last left singular vectors, (failures, m).
    weakest = np.linalg.svd(left, full_matrices=lost)[0][:, :, -1]
    # The largest component is made positive, as in `measures.weakest_direction`; + 0.0 makes
    # −0.0 to 0.0.
    largest = np.abs(weakest).argmax(axis=1)[:, None]
    weakest = weakest * np.sign(np.take_along_axis(weakest, largest, axis=1)) + 0.0
    names, directions = arm.chain.names, arm.task.directions
    left_by, components = sigmas.tolist(), weakest.tolist()
    return tuple(
        AssessedFailure(
            joints=tuple(names[joint] for joint in sets[k]),
            sigma=left_by[k],
            direction=dict(zip(directions, components[k], strict=True)),
        )
        for k in np.argsort(sigmas, kind="stable")
    )
