"""By what to choose among the manipulators of one Jacobian: the catalogue of criteria."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from formulations.realise.family import Family
from formulations.realise.links import clearance, link_lengths
from formulations.realise.motion import Motion, jacobians, move
from formulations.realise.normals import common_normals
from formulations.realise.sigmas import smallest, worst_cases
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError


@dataclass(frozen=True)
class Sampling:
    """Which displacements criteria look at; all manipulators are moved by the same ones.

    Where q and −q of a joint change places, as they do when it is flipped or the whole arm
    turned over, the same arm is sampled elsewhere, and its values differ a little.

    Parameters
    ----------
    seed
        Seed of the displacements, at least 0.
    samples
        How many displacements, at least 1.
    radius
        Radius of the neighbourhood: the norm of q, in radians and units of length.
    """

    seed: int = 0
    samples: int = 100
    radius: float = 0.2

    def __post_init__(self) -> None:
        whole_number("seed", self.seed, 0)
        whole_number("samples", self.samples, 1)
        if not 0 < self.radius < np.inf:
            raise InputError("radius", self.radius, "a finite number above 0")

    def near(self, joints: int) -> FloatArray:
        """Displacements uniform in the ball of the radius, shape (samples, joints)."""
        rng = np.random.default_rng(self.seed)
        directions = rng.standard_normal((self.samples, joints))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self.radius * rng.uniform(size=(self.samples, 1)) ** (1 / joints) * directions

    def anywhere(self, joints: int) -> FloatArray:
        """Displacements uniform in [−1, 1), shape (samples, joints); see `_workspace`."""
        return np.random.default_rng(self.seed).uniform(-1, 1, (self.samples, joints))


@dataclass(frozen=True)
class Criterion:
    """One way to judge a manipulator.

    Attributes
    ----------
    name, summary
        What it is called, and what it measures.
    larger_is_better
        Which way it is judged.
    sampled
        Whether manipulators are moved for it, which is dear: only a shortlist is.
    evaluate
        Values of all members of a family, shape (N,).
    """

    name: str
    summary: str
    larger_is_better: bool
    sampled: bool
    evaluate: Callable[[Family, Sampling], FloatArray]


def _total_length(members: Family, _: Sampling) -> FloatArray:
    return np.asarray(link_lengths(members.points, members.end_effector).sum(axis=-1))


def _largest_link(members: Family, _: Sampling) -> FloatArray:
    return np.asarray(link_lengths(members.points, members.end_effector).max(axis=-1))


def _dh_length(members: Family, _: Sampling) -> FloatArray:
    normals = common_normals(members.directions, members.points, members.end_effector)
    offsets = np.abs(normals.offsets(members.directions))
    return np.asarray((normals.lengths + offsets).sum(axis=-1))


def _clearance(members: Family, _: Sampling) -> FloatArray:
    return clearance(members.points, members.end_effector)


def _reach(members: Family, sampling: Sampling) -> FloatArray:
    away = _workspace(members, sampling).end_effector - members.points[:, None, 0]
    return np.asarray(np.linalg.norm(away, axis=-1).max(axis=-1))


def _near_after(members: Family, sampling: Sampling) -> FloatArray:
    return np.asarray(worst_cases(_near(members, sampling)).min(axis=-1))


def _near_before(members: Family, sampling: Sampling) -> FloatArray:
    return np.asarray(smallest(_near(members, sampling)).min(axis=-1))


def _workspace_after(members: Family, sampling: Sampling) -> FloatArray:
    return np.asarray(worst_cases(_anywhere(members, sampling)).mean(axis=-1))


def _workspace_before(members: Family, sampling: Sampling) -> FloatArray:
    return np.asarray(smallest(_anywhere(members, sampling)).mean(axis=-1))


def _near(members: Family, sampling: Sampling) -> FloatArray:
    displacements = sampling.near(members.prismatic.shape[1])
    return _task_jacobians(members, _moved(members, displacements[None]))


def _anywhere(members: Family, sampling: Sampling) -> FloatArray:
    return _task_jacobians(members, _workspace(members, sampling))


def _workspace(members: Family, sampling: Sampling) -> Motion:
    """Turn revolute joints by up to ±π, move prismatic ones by up to ± the size."""
    share = sampling.anywhere(members.prismatic.shape[1])
    return _moved(members, share * np.where(members.prismatic, members.size, np.pi)[:, None])


def _moved(members: Family, displacements: FloatArray) -> Motion:
    return move(
        members.directions[:, None],
        members.points[:, None],
        members.prismatic[:, None],
        members.end_effector,
        displacements,
    )


def _task_jacobians(members: Family, moved: Motion) -> FloatArray:
    return jacobians(moved, members.prismatic[:, None])[..., list(members.rows), :]


CRITERIA: Mapping[str, Criterion] = MappingProxyType(
    {
        one.name: one
        for one in (
            Criterion(
                "total-length",
                "sum of the lengths of the links, least",
                False,
                False,
                _total_length,
            ),
            Criterion("largest-link", "longest link, least", False, False, _largest_link),
            Criterion(
                "dh-length",
                "sum of common normals and offsets (a and |d| of the table), least",
                False,
                False,
                _dh_length,
            ),
            Criterion(
                "clearance",
                "smallest distance between links that share no joint, largest",
                True,
                False,
                _clearance,
            ),
            Criterion(
                "reach",
                "distance from first joint to end effector, largest sampled",
                True,
                True,
                _reach,
            ),
            Criterion(
                "neighbourhood",
                "worst case after a failure, least over sampled displacements near by, largest",
                True,
                True,
                _near_after,
            ),
            Criterion(
                "neighbourhood-before",
                "smallest singular value before a failure, least near by, largest",
                True,
                True,
                _near_before,
            ),
            Criterion(
                "workspace",
                "worst case after a failure, mean over sampled configurations, largest",
                True,
                True,
                _workspace_after,
            ),
            Criterion(
                "workspace-before",
                "smallest singular value before a failure, mean over them, largest",
                True,
                True,
                _workspace_before,
            ),
        )
    }
)


def criterion(name: str) -> Criterion:
    """Return the criterion of that name; InputError if there is none."""
    if name not in CRITERIA:
        raise InputError("criterion", name, "one of " + ", ".join(CRITERIA))
    return CRITERIA[name]
