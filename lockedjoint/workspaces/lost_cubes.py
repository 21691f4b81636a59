"""Positions that are lost for certain: out of reach with one joint locked at one angle.

A position is lost, not kept, if with some joint locked at one angle within its artificial
limits no configuration within the physical limits reaches it, or none within the artificial
limits before a failure. For a cube of positions and such an angle the box of the other joints'
positions is bisected until the tip stays away from the ball about the cube in every part, by
the bounds of `recovery.check_proof`, which pays for rounding. What is left of all that the arm
could reach is a bound of the workspace from above.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import partial
from itertools import product
from math import ceil
from typing import Any

import numpy as np

from lockedjoint.kinematics.link_chain import BoolArray
from lockedjoint.kinematics.serial_arm import Ranges, SerialArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.executors import in_groups
from lockedjoint.recovery.check_proof import SURPLUS, distances, require_bounded_rounding
from lockedjoint.workspaces.guaranteed import MOST_CUBES
from lockedjoint.workspaces.kept_cubes import KeptCubes, LostCubes
from lockedjoint.workspaces.kept_proofs import KeptProofs
from lockedjoint.workspaces.workspace import check_limits

# Boxes of the joints' positions for a cube; angles of a joint, its limits among them, that are
# tried; cubes that are looked at together, and those of a worker's task.
_BOXES, _ANGLES, _TOGETHER, _GROUP = 2000, 3, 500, 64
# Cubes that are farther away, by the arm's reach, are not looked at.
_FAR = 2
_ALLOWED = "at most 20 rotations to within 1e-14, and lengths and angles of at most 20"


class LostProofs:
    """Tries to prove of cubes that a failure takes all their positions away.

    InputError if rounding is not bounded for the arm.
    """

    def __init__(self, arm: SerialArm, limits: Ranges) -> None:
        check_limits(arm, limits)
        proofs = KeptProofs(arm, limits)
        self.arm, self.rows, self.ends = proofs.arm, proofs.rows, proofs.ends
        # Of joints that turn fully, one turn.
        self.lower = np.where(np.isinf(proofs.lower), -np.pi, proofs.lower)
        self.upper = np.where(np.isinf(proofs.upper), np.pi, proofs.upper)
        self.weights = (proofs.far + proofs.slides)[:, None]
        self.reach = float(proofs.far[0])
        frames = np.array([step.placement for step in self.arm.steps])
        frames[0] = np.eye(4)
        self.proof: dict[str, Any] = {
            "placements": frames[:, :3],
            "multipliers": np.eye(len(frames)),
            "slides": proofs.slides,
            "starts": [self.arm.tip],
            "tolerances": [0.0],
        }
        ends = {"lower": self.lower.min(axis=0), "upper": self.upper.max(axis=0)}
        try:
            require_bounded_rounding({**self.proof, **ends, "targets": [_FAR * self.reach]})
        except ValueError:
            raise InputError("the arm", "too large for a bound on rounding", _ALLOWED) from None

    def hold(self, cubes: LostCubes) -> BoolArray:
        """Return which cubes are lost, shape (k,), by their own joints and angles."""
        parts = range(0, len(cubes.width), _TOGETHER)
        return np.concatenate(
            [np.zeros(0, bool), *(self._hold(cubes[k : k + _TOGETHER]) for k in parts)]
        )

    def _hold(self, cubes: LostCubes) -> BoolArray:
        low, high = self.lower[cubes.joint].T, self.upper[cubes.joint].T
        at = np.flatnonzero(cubes.joint < len(low))
        joint, angle = cubes.joint[at], cubes.angle[at]
        low[joint, at] = high[joint, at] = angle
        target = np.full((3, len(cubes.width)), self.arm.at_zero.end_effector[2])
        target[self.rows] = cubes.centre.T
        near = np.sqrt(len(self.rows)) * cubes.width + SURPLUS
        failed, boxes = np.zeros(len(near), bool), np.zeros(len(near))
        failed[at] = (angle < self.ends[joint, 0]) | (angle > self.ends[joint, 1])
        failed |= np.linalg.norm(target, axis=0) > _FAR * self.reach
        own = np.flatnonzero(~failed)
        low, high = low[:, own], high[:, own]
        while own.size:
            proof = {**self.proof, "targets": [target[:, own]]}
            boxes += np.bincount(own, minlength=len(near))
            left = ~(distances(proof, 0, low, high) > near[own])
            low, high, own = (each[..., left] for each in (low, high, own))
            # A configuration that reaches the cube, or too many boxes: it is not proved.
            tip = self.arm.chain.tip_at((low + high) / 2)[0]
            reached = np.all(np.abs(tip - target[:, own]) <= cubes.width[own], axis=0)
            failed[own[reached | (boxes[own] > _BOXES)]] = True
            low, high, own = (each[..., ~failed[own]] for each in (low, high, own))
            split = np.argmax((high - low) * self.weights, axis=0)
            first = 2 * np.arange(len(own))
            low, high, own = (np.repeat(each, 2, axis=-1) for each in (low, high, own))
            middle = (low[split, first] + high[split, first]) / 2
            high[split, first] = low[split, first + 1] = middle
        return ~failed


def lost_cubes(
    kept: KeptCubes,
    finest: float,
    levels: int = 3,
    *,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[LostCubes]:
    """Prove of cubes that all their positions are lost; yield those of some, then of more.

    Parameters
    ----------
    kept
        Cubes that are kept for certain, which are passed over.
    finest, levels, executor, progress
        As of `guaranteed_workspace`.

    Raises
    ------
    InputError
        If the first cubes are too many, or rounding is not bounded for the arm.
    """
    first = cubes_around(kept.arm, kept.limits, finest, levels)
    groups = np.array_split(first, ceil(len(first) / _GROUP))
    work = partial(_lost, kept, finest * 2**levels, levels)
    calls = [(group,) for group in groups]
    yield from in_groups(work, calls, executor, progress, "groups of cubes from above")


def cubes_around(arm: SerialArm, limits: Ranges, finest: float, levels: int) -> FloatArray:
    """Return middles of the first cubes, (k, m), which hold the arm's reach.

    InputError as of `lost_cubes`: better known before other cubes are worked on.
    """
    width = finest * 2**levels
    proofs = LostProofs(arm, limits)
    count, m = ceil(proofs.reach * (1 + 1e-9) / (2 * width)), len(proofs.rows)
    if (2 * count) ** m > MOST_CUBES:
        allowed = f"a length for which the first cubes are at most {MOST_CUBES}"
        raise InputError("finest", finest, f"{allowed}; or more halvings")
    middles = np.array(list(product(range(-count, count), repeat=m))) + 0.5
    return np.asarray(middles * 2 * width)


def _lost(kept: KeptCubes, width: float, levels: int, centre: FloatArray) -> LostCubes:
    """Return the cubes that are lost of some and, where they are not, of their parts."""
    proofs, found = LostProofs(kept.arm, kept.limits), []
    ways = [(len(kept.limits), 0.0)]
    ways += [
        (j, at) for j, ends in enumerate(kept.limits) for at in np.linspace(*ends, _ANGLES)
    ]
    parts = np.array(list(product((-1, 1), repeat=centre.shape[1]))) / 2
    for _ in range(levels + 1):
        own = kept.centre[np.isclose(kept.width, width)]
        known = set(map(tuple, np.floor(own / (2 * width)).tolist()))
        cells = np.floor(centre / (2 * width)).tolist()
        centre = centre[[tuple(cell) not in known for cell in cells]]
        for joint, angle in ways:
            columns = (np.full(len(centre), value) for value in (width, joint, angle))
            cubes = LostCubes(centre, *columns)
            lost = proofs.hold(cubes)
            found.append(cubes[lost])
            centre = centre[~lost]
        centre = (centre[:, None] + width * parts).reshape(-1, parts.shape[1])
        width /= 2
    return LostCubes.joined(found)
