"""Criteria that choose among the manipulators of one Jacobian: three, and a user's own.

* clearance: the smallest distance between two links that do not meet at a joint; large is good.
* total-length: the sum of the links' lengths; small is good.
* kept: how large a part of the positions about the end effector an arm keeps whichever joint
  fails, within artificial limits about q = 0; large is good. Positions are sampled.

A criterion judges many manipulators at once: a `Family` of N arms with n joints gives N values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from lockedjoint.kinematics.inverse import kept
from lockedjoint.nlp.arrays import FloatArray, check_length, real_number, whole_number
from lockedjoint.nlp.errors import InputError, LockedJointError, one_of
from lockedjoint.synthesis.family import Family
from lockedjoint.synthesis.links import clearance, link_lengths
from lockedjoint.synthesis.manipulator import Manipulator, TaskRows

# Largest number of sampled joint positions, over all arms that are judged at once: memory.
_MOST_POSITIONS = 5_000_000
# Radius of the ball in which positions are kept, in root mean square lever arms times
# half-widths of the artificial limits. The best arm of seven joints reaches little beyond it: a
# larger ball would have more samples outside of every arm's reach.
_BALL = 4.0
# Number of sampled positions with which `kept` chooses its shortlist.
COARSE = 8
#: A user's own criterion: the value of one manipulator.
Judge = Callable[[Manipulator], float]


@dataclass(frozen=True)
class Sampling:
    """Which positions `kept` samples; they are the same for all manipulators.

    Parameters
    ----------
    seed
        Seed of the positions, at least 0.
    samples
        How many positions, at least 1.
    radius
        Half-width of the artificial limits, in radians and units of length.
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

    def offsets(self, dimension: int) -> FloatArray:
        """Return at least `samples` points of the unit ball or disc, in opposite pairs.

        The dimension is 3 or 2; the shape is (points, 3), with z = 0 in a disc.
        """
        count = (self.samples + 1) // 2
        rng = np.random.default_rng(self.seed)
        directions = rng.standard_normal((count, dimension))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        points = np.zeros((count, 3))
        points[:, :dimension] = rng.uniform(size=(count, 1)) ** (1 / dimension) * directions
        return np.concatenate([points, -points])


@dataclass(frozen=True)
class Criterion:
    """One way to judge a manipulator, by its name in `CRITERIA`.

    A criterion that follows self-motion is defined for arms with `one_more_joint` only. Its
    shortlist is the best of `COARSE` samples. If the task fixes all directions, an arm has the
    value of the arm with its joints in the reverse order.
    """

    name: str
    #: It returns the value of each member of a family, shape (N,).
    evaluate: Callable[[Family, Sampling], FloatArray]
    larger_is_better: bool = False
    costly: bool = False  #: Only a shortlist of manipulators is judged.
    self_motion: bool = False  #: It follows self-motion.

    def cost(self, members: Family, sampling: Sampling) -> FloatArray:
        """Return the values with the sign for which the least is the best, shape (N,)."""
        return self.sign * self.evaluate(members, sampling)

    @property
    def sign(self) -> int:
        """What a value is multiplied with so that the least is the best."""
        return -1 if self.larger_is_better else 1


def one_more_joint(joints: int, task: TaskRows) -> bool:
    """Whether a pose of the task leaves a curve of configurations."""
    return joints == len(task.rows) + 1 and task is not TaskRows.ROTATIONAL


def _kept(members: Family, sampling: Sampling) -> FloatArray:
    """Return area or volume of the positions that are kept whichever joint fails, (N,).

    See `inverse.kept`; NaN for arms that have not `one_more_joint`.
    """
    arms, joints = members.prismatic.shape
    if not one_more_joint(joints, members.task):
        return np.full(arms, np.nan)
    radius, dimension = _ball(members, sampling)
    offsets = radius * sampling.offsets(dimension)
    shares = kept(members, members.task.rows, offsets, sampling.radius).mean(axis=1)
    return np.asarray(kept_ball(sampling, members) * shares)


def kept_ball(sampling: Sampling, members: Family) -> float:
    """Return the volume of the ball, or area of the disc, in which positions are sampled."""
    radius, dimension = _ball(members, sampling)
    return float(radius**dimension * (np.pi if dimension == 2 else 4 * np.pi / 3))


def _ball(members: Family, sampling: Sampling) -> tuple[float, int]:
    """Return the ball's radius, in the arms' unit of length, and its dimension: 3, or 2."""
    linear = members.velocities()[0, :3]
    lever = float(np.sqrt(np.mean(np.sum(linear**2, axis=0))))
    return _BALL * sampling.radius * lever, 2 if members.task.in_plane else 3


def _total_length(members: Family, _: Sampling) -> FloatArray:
    """Return the sum of the lengths of each arm's links, shape (N,)."""
    return np.asarray(link_lengths(members.points, members.end_effector).sum(axis=-1))


def _clearance(members: Family, _: Sampling) -> FloatArray:
    """Return the smallest distance of links that do not meet, of each arm, shape (N,)."""
    return clearance(members.points, members.end_effector)


# The library's own criteria.
_OURS = (
    Criterion("clearance", _clearance, larger_is_better=True),
    Criterion("total-length", _total_length),
    Criterion("kept", _kept, larger_is_better=True, costly=True, self_motion=True),
)
# All criteria by name; `register_criterion` adds to it.
_known = {by.name: by for by in _OURS}
#: All criteria by name, to be read only.
CRITERIA: Mapping[str, Criterion] = MappingProxyType(_known)
#: Names of the library's own criteria, of which every choice has the values.
BUILT_IN = tuple(_known)


def register_criterion(name: str, judge: Judge, *, larger_is_better: bool = False) -> None:
    """List a criterion of your own under a name, for this process.

    The file of ``--plugin FILE.py`` may call it: then ``realise --criterion NAME`` uses it.

    Parameters
    ----------
    name
        The name, which no other criterion has.
    judge
        A function of a `Manipulator` that returns one finite number.
    larger_is_better
        Whether the largest value is the best; by default the least is.

    Raises
    ------
    InputError
        If another criterion has the name, or the judge is no function.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> def reach(arm):
    ...     return float(abs(arm.points).max())
    >>> lj.register_criterion("reach", reach)
    >>> robot = lj.realise(lj.optimal_jacobian(8))
    >>> lj.choose_arrangement(robot, "reach").criterion
    'reach'
    """
    made = _own(name, judge, larger_is_better)
    if made.name in _known:
        raise InputError("criterion", name, "a name that no other criterion has")
    _known[made.name] = made


def criterion_of(by: str | Judge) -> Criterion:
    """Return a criterion by its name, or of a function of which the least value is the best.

    InputError if there is no such criterion.
    """
    if callable(by):
        return _own(getattr(by, "__name__", "function"), by, larger_is_better=False)
    return CRITERIA[one_of("criterion", by, CRITERIA)]


def _own(name: object, judge: object, larger_is_better: bool) -> Criterion:
    """Return the criterion of a user's function; InputError if that is none, or has no name."""
    if not isinstance(name, str) or not name:
        raise InputError("criterion", name, "a name")
    if not callable(judge):
        raise InputError("judge", judge, "a function of a Manipulator")

    def judged(arm: Manipulator) -> Any:
        try:
            return judge(arm)
        except LockedJointError:
            raise
        except Exception as error:
            said = f"{type(error).__name__}: {error}"
            raise InputError(name, said, "a function that returns a number") from error

    def evaluate(members: Family, _: Sampling) -> FloatArray:
        allowed = "a finite number for every manipulator"
        return np.array([real_number(name, judged(arm), allowed) for arm in members.arms()])

    return Criterion(name, evaluate, larger_is_better, costly=True)
