"""The manipulators that share one Jacobian: orders and flips, and which are the same.

Two arrangements are identical when a rigid motion of space carries the axes of the one, in
their order, to those of the other and leaves the end effector where it is. Axes are lines: they
have no sense. A mirror image is another manipulator. Such motions permute the axes (and, where
axes may be reflected through the end effector, their reflections), so they form a finite group
G; no member but the identity leaves any arrangement as it is, hence the number of distinct
manipulators is the number of arrangements divided by |G|.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product
from math import factorial

import numpy as np
import numpy.typing as npt

from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.manipulator import Manipulator, TaskRows

# Lengths and cosines closer than this, relative to the manipulator's size, count as equal.
_EQUAL = 1e-6
# Partial members of a group that are kept side by side.
_MOST_PARTS = 5_000
# Images of the first few axes: to which axis, and the signs of its place and direction.
_Part = tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, eq=False)
class Arrangements:
    """Orders and flips, (N, n) each, of a manipulator's joints, see `Manipulator.arranged`."""

    orders: IntArray
    flips: BoolArray

    def __len__(self) -> int:
        return len(self.orders)

    def __getitem__(self, chosen: npt.ArrayLike | slice) -> Arrangements:
        which = chosen if isinstance(chosen, slice) else np.asarray(chosen)
        return Arrangements(self.orders[which], self.flips[which])


@dataclass(frozen=True, eq=False)
class Family(JointAxes):
    """Manipulators side by side: N chains of n joints each, and one end effector, shape (3,).

    Task and size are those of the manipulator they came from; speeds and columns have the
    shape (N, n).
    """

    task: TaskRows
    size: float
    speeds: FloatArray
    columns: IntArray

    def arms(self) -> Iterator[Manipulator]:
        """Yield each chain as a manipulator of its own."""
        parts = (self.directions, self.points, self.prismatic, self.speeds, self.columns)
        for directions, points, prismatic, speeds, columns in zip(*parts, strict=True):
            yield Manipulator(
                directions=directions,
                points=points,
                prismatic=prismatic,
                end_effector=self.end_effector,
                task=self.task,
                columns=tuple(columns.tolist()),
                speeds=speeds,
            )


def family(manipulator: Manipulator, arrangements: Arrangements | None = None) -> Family:
    """Return the geometry of arrangements of a manipulator: of it alone if left out."""
    if arrangements is None:
        n = manipulator.joints
        arrangements = Arrangements(np.arange(n)[None], np.zeros((1, n), dtype=bool))
    chains = manipulator.rearranged(arrangements.orders, arrangements.flips)
    return Family(
        **vars(chains),
        task=manipulator.task,
        size=manipulator.size,
        speeds=manipulator.speeds[arrangements.orders],
        columns=np.array(manipulator.columns)[arrangements.orders],
    )


def flippable(manipulator: Manipulator) -> BoolArray:
    """Which joints a flip moves to another place, shape (n,).

    Revolute ones of planar and positional tasks whose axis does not pass through the end
    effector. Any other flip only changes the sign of a joint's displacement.
    """
    if not manipulator.task.free_directions:
        return np.zeros(manipulator.joints, dtype=bool)
    lever = np.linalg.norm(manipulator.points - manipulator.end_effector, axis=1)
    return np.asarray(~manipulator.prismatic & (lever > 1e-9 * manipulator.size))


def count(manipulator: Manipulator) -> int:
    """Return the number of orders and of flips that move a joint: n!·2ᶠ arrangements."""
    return factorial(manipulator.joints) << int(np.sum(flippable(manipulator)))


def every(manipulator: Manipulator) -> Arrangements:
    """Return all n!·2ᶠ arrangements, in lexicographic order."""
    n, free = manipulator.joints, flippable(manipulator)
    orders = np.array(list(permutations(range(n))), dtype=np.int64)
    choices = [(False, True) if can else (False,) for can in free]
    flips = np.array(list(product(*choices)), dtype=bool)
    repeated = np.repeat(orders, len(flips), axis=0)
    tiled = np.tile(flips, (len(orders), 1))
    return Arrangements(repeated, np.take_along_axis(tiled, repeated, axis=1))


def symmetries(manipulator: Manipulator) -> Arrangements | None:
    """Return the group G, or None if the search for it passes `_MOST_PARTS` partial members.

    A member carries axis i to axis ``orders[i]``, or to its reflection where ``flips[i]``.
    """
    places, axes = _places(manipulator) / manipulator.size, manipulator.directions
    kind = manipulator.prismatic + 2 * flippable(manipulator)
    parts: list[_Part] = [()]
    for _ in range(manipulator.joints):
        parts = [longer for part in parts for longer in _extended(part, places, axes, kind)]
        if len(parts) > _MOST_PARTS:
            return None
    members = {
        tuple((image, place < 0) for image, place, _ in part)
        for part in parts
        if _is_rotation(part, places, axes)
    }
    listed = np.array(sorted((*zip(*member, strict=True),) for member in members))
    return Arrangements(listed[:, 0].astype(np.int64), listed[:, 1].astype(bool))


def distinct(arrangements: Arrangements, group: Arrangements | None) -> Arrangements:
    """Return the first, lexicographically, of each set of identical arrangements.

    Without a group, as `symmetries` has it for too many members, all arrangements are kept.
    """
    if group is None:
        return arrangements
    rest, own = arrangements, _code(arrangements.orders, arrangements.flips)
    for images, flips in zip(group.orders, group.flips, strict=True):
        first = own <= _code(images[rest.orders], rest.flips ^ flips[rest.orders])
        rest, own = rest[first], own[first]
    return rest


def _places(manipulator: Manipulator) -> FloatArray:
    """Offsets of axes from the end effector; of a prismatic joint only the direction counts."""
    away = manipulator.points - manipulator.end_effector
    along = np.sum(away * manipulator.directions, axis=1, keepdims=True)
    nearest = away - along * manipulator.directions
    return np.where(manipulator.prismatic[:, None], 0.0, nearest)


def _extended(part: _Part, places: FloatArray, axes: FloatArray, kind: IntArray) -> list[_Part]:
    """All choices of the next axis' image that keep distances and angles."""
    new = len(part)
    taken = {image for image, _, _ in part}
    before = np.vstack([places[: new + 1], axes[: new + 1]])
    # Only inner products with the new axis can be new.
    pair = [new, 2 * new + 1]
    longer_parts = []
    for image in range(len(axes)):
        if image in taken or kind[image] != kind[new]:
            continue
        for place, sense in product((1, -1) if kind[new] > 1 else (1,), (1, -1)):
            longer = (*part, (image, place, sense))
            after = _carried(longer, places, axes)
            change = after @ after[pair].T - before @ before[pair].T
            if np.abs(change).max() < _EQUAL:
                longer_parts.append(longer)
    return longer_parts


def _carried(part: _Part, places: FloatArray, axes: FloatArray) -> FloatArray:
    """Places and then directions of the images, shape (2k, 3) for k axes."""
    images, place_signs, senses = np.array(part).T
    return np.vstack([place_signs[:, None] * places[images], senses[:, None] * axes[images]])


def _is_rotation(part: _Part, places: FloatArray, axes: FloatArray) -> bool:
    """Whether a proper rotation does it: the best one, by the singular value method."""
    before, after = np.vstack([places, axes]), _carried(part, places, axes)
    u, _, vt = np.linalg.svd(after.T @ before)
    proper = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return bool(np.max(np.abs(before @ proper.T - after)) < 10 * _EQUAL)


def _code(orders: IntArray, flips: BoolArray) -> IntArray:
    n = orders.shape[1]
    powers = (2 * n) ** np.arange(n - 1, -1, -1, dtype=np.int64)
    return np.asarray((2 * orders + flips) @ powers)
