"""The manipulators that share one Jacobian: orders and flips, and which are the same.

Two arrangements are identical when a rigid motion of space carries the axes of the one, in
their order, to those of the other and leaves the end effector where it is. Axes are lines: they
have no sense. A mirror image is another manipulator. Such motions permute the axes (and, where
axes may be reflected through the end effector, their reflections), so they form a finite group
G; no member but the identity leaves any arrangement as it is, hence the number of distinct
manipulators is the number of arrangements divided by |G|.

Letters: n joints, N arrangements, f joints that a flip moves. An arrangement is an *order*,
which joint comes first, second, …, counted from 0, and a *flip* for each joint in this order:
true if the joint's axis is turned round and, if it is a revolute one of a planar or positional
task, reflected through the end effector besides, see `Manipulator.arranged`. Orders have the
shape (N, n), int64, and flips (N, n), bool. The *place* of an axis is the offset of its nearest
point from the end effector, in metres, or in shares of the manipulator's size where the search
for symmetries needs it. The *kind* of a joint is 0 or 1 (revolute, prismatic), and 2 more if a
flip moves it.

The group is found by a search over joints 0, 1, …: a *part* has the images of the first few of
them, and is kept if all inner products of places and directions are as before.
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

# Difference up to which inner products of places (in shares of the manipulator's size) and of
# directions are equal. With a larger one, arms that are nearly symmetric count as symmetric.
_EQUAL = 1e-6
# Factor by which a coordinate of an image may miss that, as the rotation is fitted to all axes
# at once.
_ROTATION_SLACK = 10
# Distance of an axis from the end effector, in shares of the size, up to which it passes
# through.
_THROUGH_TIP = 1e-9
# Largest number of partial members of a group side by side: beyond it symmetries are not known.
_MOST_PARTS = 5_000
# Type of a part: for each of the first few axes, the axis that it is carried to, and the signs,
# 1 or -1, of that one's place and direction.
_Part = tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, eq=False)
class Arrangements:
    """Arrangements of a manipulator's joints, see `Manipulator.arranged`."""

    orders: IntArray  #: Joints from base to tip, counted from 0, shape (N, n).
    flips: BoolArray  #: Whether each joint in these orders is flipped, shape (N, n).

    def __len__(self) -> int:
        """Return N."""
        return len(self.orders)

    def __getitem__(self, chosen: npt.ArrayLike | slice) -> Arrangements:
        """Return some arrangements, by a slice, their numbers or truth values, shape (N,)."""
        which = chosen if isinstance(chosen, slice) else np.asarray(chosen)
        return Arrangements(self.orders[which], self.flips[which])


@dataclass(frozen=True, eq=False)
class Family(JointAxes):
    """Manipulators side by side: N chains of n joints each, and one end effector, shape (3,).

    `directions` and `points` have the shape (N, n, 3), and `prismatic` the shape (N, n).
    """

    task: TaskRows  #: That of the manipulator they came from.
    size: float  #: Its size, see `Manipulator.size`.
    #: Metres by which a prismatic joint moves per unit of its position, shape (N, n).
    speeds: FloatArray
    columns: IntArray  #: Column of the Jacobian that each joint contributes, shape (N, n).

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
    """Return the geometry of N arrangements of a manipulator: of itself, N = 1, if left out."""
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

    These are revolute joints of planar and positional tasks whose axis does not pass through
    the end effector. Any other flip only changes the sign of a joint's displacement.
    """
    if not manipulator.task.free_directions:
        return np.zeros(manipulator.joints, dtype=bool)
    lever = np.linalg.norm(manipulator.points - manipulator.end_effector, axis=1)
    return np.asarray(~manipulator.prismatic & (lever > _THROUGH_TIP * manipulator.size))


def count(manipulator: Manipulator) -> int:
    """Return the number of orders and of flips that move a joint: n!·2ᶠ arrangements."""
    return factorial(manipulator.joints) << int(np.sum(flippable(manipulator)))


def every(manipulator: Manipulator) -> Arrangements:
    """Return all n!·2ᶠ arrangements, in lexicographic order of orders, flips by joint."""
    n, free = manipulator.joints, flippable(manipulator)
    orders = np.array(list(permutations(range(n))), dtype=np.int64)
    choices = [(False, True) if can else (False,) for can in free]
    # These flips are those of joints 0, 1, …; at the end they are put in the joints' order.
    flips = np.array(list(product(*choices)), dtype=bool)
    repeated = np.repeat(orders, len(flips), axis=0)
    tiled = np.tile(flips, (len(orders), 1))
    return Arrangements(repeated, np.take_along_axis(tiled, repeated, axis=1))


def symmetries(manipulator: Manipulator) -> Arrangements | None:
    """Return the group G, or None if the search for it passes `_MOST_PARTS` partial members.

    Each of its N members, one row, carries axis i to axis ``orders[i]``, or to its reflection
    through the end effector where ``flips[i]``.
    """
    places, axes = _places(manipulator) / manipulator.size, manipulator.directions
    kind = manipulator.prismatic + 2 * flippable(manipulator)
    parts: list[_Part] = [()]  # images of no axis yet; each round adds one axis
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

    Of N arrangements of all joints, and of the group G. An arrangement stays if no member of G
    leads to one that comes before it. Without a group, None as `symmetries` returns where it is
    too large, all arrangements stay.
    """
    if group is None:
        return arrangements
    # `own` has the numbers of the arrangements that are left, see `_code`.
    rest, own = arrangements, _code(arrangements.orders, arrangements.flips)
    for images, flips in zip(group.orders, group.flips, strict=True):
        first = own <= _code(images[rest.orders], rest.flips ^ flips[rest.orders])
        rest, own = rest[first], own[first]
    return rest


def _places(manipulator: Manipulator) -> FloatArray:
    """Return the places of the axes, shape (n, 3), in metres, orthogonal to the axes.

    They are 0 for prismatic joints, of which only the direction counts.
    """
    away = manipulator.points - manipulator.end_effector
    along = np.sum(away * manipulator.directions, axis=1, keepdims=True)
    nearest = away - along * manipulator.directions
    return np.where(manipulator.prismatic[:, None], 0.0, nearest)


def _extended(part: _Part, places: FloatArray, axes: FloatArray, kind: IntArray) -> list[_Part]:
    """Return a part with one axis more, for each image of that axis which keeps inner products.

    Places and axes (directions) have the shape (n, 3), and kinds (n,). Both senses of the
    image are tried, as axes are lines, and the reflected place where a flip moves the joint.
    """
    new = len(part)
    taken = {image for image, _, _ in part}
    before = np.vstack([places[: new + 1], axes[: new + 1]])
    # Only inner products with the new axis, its place and its direction, can be new.
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
    """Return the places and then the directions of the images of k axes, shape (2k, 3)."""
    images, place_signs, senses = np.array(part).T
    return np.vstack([place_signs[:, None] * places[images], senses[:, None] * axes[images]])


def _is_rotation(part: _Part, places: FloatArray, axes: FloatArray) -> bool:
    """Whether a proper rotation carries the axes to their images.

    The rotation is the best one in least squares, by the singular value decomposition (Kabsch's
    method). A part with all n axes may keep all inner products and be a reflection, whose
    determinant is −1: no proper rotation fits it.
    """
    before, after = np.vstack([places, axes]), _carried(part, places, axes)
    u, _, vt = np.linalg.svd(after.T @ before)
    proper = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return bool(np.max(np.abs(before @ proper.T - after)) < _ROTATION_SLACK * _EQUAL)


def _code(orders: IntArray, flips: BoolArray) -> IntArray:
    """Return a number for each arrangement, shape (N,), ascending in lexicographic order.

    Its digits in the base 2n are 2·joint + flip, from the base to the tip.
    """
    n = orders.shape[1]
    powers = (2 * n) ** np.arange(n - 1, -1, -1, dtype=np.int64)
    return np.asarray((2 * orders + flips) @ powers)
