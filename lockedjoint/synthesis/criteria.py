"""By what to choose among the manipulators of one Jacobian: the criteria by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from lockedjoint.formulations.measures import worst_case_sigma_batch
from lockedjoint.kinematics.inverse import kept
from lockedjoint.nlp.arrays import FloatArray, check_length, whole_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.synthesis.dh import common_normals
from lockedjoint.synthesis.family import Family
from lockedjoint.synthesis.links import clearance, link_lengths
from lockedjoint.synthesis.manipulator import TaskRows

# So many Jacobians are decomposed at once, which bounds the memory.
_CHUNK = 1 << 13
# Sampled positions of joints, over all arms that are judged at once.
_MOST_POSITIONS = 5_000_000
# Radius of the ball in which positions are kept, in root mean square lever arms and widths of
# the artificial limits. The best 7R reaches little beyond it.
_BALL = 4.0
# Samples of displacements or positions with which a shortlist is chosen.
COARSE = 8
_Measure = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Sampling:
    """Which displacements criteria sample; all manipulators are moved by the same ones.

    Where q and −q of a joint change places, as they do when it is flipped or the whole arm
    turned over, the same arm is sampled elsewhere, and its values differ a little.

    Parameters
    ----------
    seed
        Seed of the displacements, at least 0.
    samples
        How many displacements, at least 1.
    radius
        Radius of the neighbourhood: the norm of q, in radians and units of length. For
        `kept` the half-width of the artificial limits.
    """

    seed: int = 0
    samples: int = 100
    radius: float = 0.2

    def __post_init__(self) -> None:
        whole_number("seed", self.seed, 0)
        whole_number("samples", self.samples, 1)
        check_length("radius", self.radius)

    def check(self, arms: int, joints: int) -> None:
        """Raise InputError if so many arms have too many sampled positions for the memory."""
        most = _MOST_POSITIONS // (arms * joints)
        if self.samples > most:
            allowed = f"at most {most} for {arms} arms of {joints} joints"
            raise InputError("samples", self.samples, allowed)

    def near(self, joints: int) -> FloatArray:
        """Displacements uniform in the ball of the radius, shape (samples, joints)."""
        rng = np.random.default_rng(self.seed)
        directions = rng.standard_normal((self.samples, joints))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self.radius * rng.uniform(size=(self.samples, 1)) ** (1 / joints) * directions

    def offsets(self, dimension: int) -> FloatArray:
        """Points of the unit ball or disc in opposite pairs, at least `samples`, (…, 3)."""
        count = (self.samples + 1) // 2
        points = np.zeros((count, 3))
        points[:, :dimension] = Sampling(self.seed, count, 1.0).near(dimension)
        return np.concatenate([points, -points])

    def anywhere(self, joints: int) -> FloatArray:
        """Displacements uniform in [−1, 1), shape (samples, joints); see `_in_workspace`."""
        return np.random.default_rng(self.seed).uniform(-1, 1, (self.samples, joints))


@dataclass(frozen=True)
class Criterion:
    """One way to judge a manipulator, by its name in `CRITERIA`.

    Where self-motion is followed it is defined for arms with `one_more_joint` only, its
    shortlist is the best of `COARSE` samples, and an arm has the value of that with its joints
    in the reverse order, if the task fixes all directions.
    """

    name: str
    evaluate: Callable[[Family, Sampling], FloatArray]  #: Of all members, shape (N,).
    larger_is_better: bool = False
    sampled: bool = False  #: Manipulators are moved, which is costly: only a shortlist is.
    self_motion: bool = False

    def cost(self, members: Family, sampling: Sampling) -> FloatArray:
        """Values with the sign for which the least is the best, shape (N,)."""
        return self.sign * self.evaluate(members, sampling)

    @property
    def sign(self) -> int:
        """What a value is multiplied with so that the least is the best."""
        return -1 if self.larger_is_better else 1


def smallest(jacobians: FloatArray) -> FloatArray:
    """σ_m of each Jacobian, before a failure; shape (…) for (…, m, n)."""
    return np.asarray(np.linalg.svd(jacobians, compute_uv=False)[..., -1])


def worst_cases(jacobians: FloatArray) -> FloatArray:
    """Smallest σ_m over the one joint that locks (eq. 5); shape (…) for (…, m, n), n > m."""
    *lead, m, n = jacobians.shape
    flat = jacobians.reshape(-1, m, n)
    parts = [
        worst_case_sigma_batch(flat[at : at + _CHUNK]).sigma
        for at in range(0, len(flat), _CHUNK)
    ]
    return np.concatenate(parts).reshape(lead)


def _lengths(members: Family) -> FloatArray:
    return link_lengths(members.points, members.end_effector)


def _dh_length(members: Family, _: Sampling) -> FloatArray:
    """Sum of common normals and offsets: a and |d| of the Denavit–Hartenberg table."""
    normals = common_normals(members)
    offsets = np.abs(normals.offsets(members.directions))
    return np.asarray((normals.lengths + offsets).sum(axis=-1))


def _reach(members: Family, sampling: Sampling) -> FloatArray:
    """Largest sampled distance from the first joint to the end effector."""
    moved = members.displaced(_in_workspace(members, sampling))
    away = moved.end_effector - members.points[:, None, 0]
    return np.asarray(np.linalg.norm(away, axis=-1).max(axis=-1))


def _near(members: Family, sampling: Sampling, measure: _Measure) -> FloatArray:
    """Least value of a measure over sampled displacements near q = 0."""
    near = sampling.near(members.prismatic.shape[1])[None]
    return np.asarray(measure(members.jacobians(near)).min(axis=-1))


def _mean(members: Family, sampling: Sampling, measure: _Measure) -> FloatArray:
    """Mean of a measure over sampled configurations."""
    anywhere = _in_workspace(members, sampling)
    return np.asarray(measure(members.jacobians(anywhere)).mean(axis=-1))


def one_more_joint(joints: int, task: TaskRows) -> bool:
    """Whether a pose of the task leaves a curve of configurations."""
    return joints == len(task.rows) + 1 and task is not TaskRows.ROTATIONAL


def _kept(members: Family, sampling: Sampling) -> FloatArray:
    """Area or volume of the positions that are kept whichever joint fails, see `kept`."""
    arms, joints = members.prismatic.shape
    if not one_more_joint(joints, members.task):
        return np.full(arms, np.nan)
    radius, dimension = _ball(members, sampling)
    offsets = radius * sampling.offsets(dimension)
    shares = kept(members, members.task.rows, offsets, sampling.radius).mean(axis=1)
    return np.asarray(kept_ball(sampling, members) * shares)


def kept_ball(sampling: Sampling, members: Family) -> float:
    """Volume of the ball, or area of the disc, of whose positions `kept` is the share."""
    radius, dimension = _ball(members, sampling)
    return float(radius**dimension * (np.pi if dimension == 2 else 4 * np.pi / 3))


def _ball(members: Family, sampling: Sampling) -> tuple[float, int]:
    linear = members.velocities()[0, :3]
    lever = float(np.sqrt(np.mean(np.sum(linear**2, axis=0))))
    return _BALL * sampling.radius * lever, 2 if members.task.in_plane else 3


def _in_workspace(members: Family, sampling: Sampling) -> FloatArray:
    """Turn revolute joints by up to ±π, move prismatic ones by up to ± the size."""
    share = sampling.anywhere(members.prismatic.shape[1])
    return share * np.where(members.prismatic, members.size, np.pi)[:, None]


_ALL = (
    Criterion("total-length", lambda arms, _: _lengths(arms).sum(axis=-1)),
    Criterion("largest-link", lambda arms, _: _lengths(arms).max(axis=-1)),
    Criterion("dh-length", _dh_length),
    Criterion("clearance", lambda arms, _: clearance(arms.points, arms.end_effector), True),
    Criterion("reach", _reach, True, True),
    # After the worst failure, and before any.
    Criterion("neighbourhood", partial(_near, measure=worst_cases), True, True),
    Criterion("neighbourhood-before", partial(_near, measure=smallest), True, True),
    Criterion("workspace", partial(_mean, measure=worst_cases), True, True),
    Criterion("workspace-before", partial(_mean, measure=smallest), True, True),
    Criterion("kept", _kept, True, True, True),
)
CRITERIA: Mapping[str, Criterion] = MappingProxyType({by.name: by for by in _ALL})
