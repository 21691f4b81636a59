"""Which arrangements of joints are one and the same manipulator.

Two arrangements are identical when a rigid motion of space carries the axes of the one, in
their order, to those of the other and leaves the end effector where it is. Axes are lines: they
have no sense. A mirror image is another manipulator. Such motions permute the axes (and, where
axes may be reflected through the end effector, their reflections), so they form a finite group
G; no member but the identity leaves any arrangement as it is, hence the number of distinct
manipulators is the number of arrangements divided by |G|.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from formulations.realise.family import Arrangements, IntArray, flippable
from formulations.realise.manipulator import Manipulator
from formulations.realise.motion import BoolArray
from nlp.arrays import FloatArray

# Lengths and cosines closer than this, relative to the manipulator's size, count as equal.
EQUAL = 1e-6
# Images of the first few axes: to which axis, and the signs of its place and direction.
_Part = tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, eq=False)
class Symmetries:
    """The group G.

    Attributes
    ----------
    images
        Where each member carries axis i, shape (|G|, n).
    flips
        Whether it carries it to the reflection of that axis, shape (|G|, n).
    """

    images: IntArray
    flips: BoolArray

    def __len__(self) -> int:
        return len(self.images)


def symmetries(manipulator: Manipulator, limit: int = 5_000) -> Symmetries | None:
    """Return the group G, or None if the search for it passes `limit` partial members."""
    places, axes = _places(manipulator) / manipulator.size, manipulator.directions
    slide, free = manipulator.prismatic, flippable(manipulator)
    found: list[_Part] = [()]
    for _ in range(manipulator.joints):
        found = [more for part in found for more in _extended(part, places, axes, slide, free)]
        if len(found) > limit:
            return None
    members = {
        tuple((image, place < 0) for image, place, _ in part)
        for part in found
        if _is_rotation(part, places, axes)
    }
    listed = np.array(sorted((*zip(*one, strict=True),) for one in members))
    return Symmetries(listed[:, 0].astype(np.int64), listed[:, 1].astype(bool))


def distinct(arrangements: Arrangements, group: Symmetries | None) -> Arrangements:
    """Return one arrangement of each set of identical ones: the first, lexicographically.

    Without a group, as `symmetries` has it for too many members, all arrangements are kept.
    """
    if group is None:
        return arrangements
    n = arrangements.orders.shape[1]
    left, own = arrangements, _code(arrangements.orders, arrangements.flips, n)
    for images, flips in zip(group.images, group.flips, strict=True):
        turned = left.flips ^ flips[left.orders]
        first = own <= _code(images[left.orders], turned, n)
        left, own = left[first], own[first]
    return left


def _places(manipulator: Manipulator) -> FloatArray:
    """Offsets of axes from the end effector; of a prismatic joint only the direction counts."""
    away = manipulator.points - manipulator.end_effector
    along = np.sum(away * manipulator.directions, axis=1, keepdims=True)
    nearest = away - along * manipulator.directions
    return np.where(manipulator.prismatic[:, None], 0.0, nearest)


def _extended(
    part: _Part, places: FloatArray, axes: FloatArray, slide: BoolArray, free: BoolArray
) -> list[_Part]:
    """All choices of the next axis' image that keep distances and angles."""
    new = len(part)
    taken = {image for image, _, _ in part}
    before = np.vstack([places[: new + 1], axes[: new + 1]])
    # Only inner products with the new axis can be new.
    pair = [new, 2 * new + 1]
    found = []
    for image in range(len(axes)):
        if image in taken or slide[image] != slide[new] or free[image] != free[new]:
            continue
        for place, sense in product((1, -1) if free[new] else (1,), (1, -1)):
            longer = (*part, (image, place, sense))
            after = _carried(longer, places, axes)
            change = after @ after[pair].T - before @ before[pair].T
            if np.abs(change).max() < EQUAL:
                found.append(longer)
    return found


def _carried(part: _Part, places: FloatArray, axes: FloatArray) -> FloatArray:
    """Places and then directions of the images, shape (2k, 3) for k axes."""
    images, place_signs, senses = np.array(part).T
    return np.vstack([place_signs[:, None] * places[images], senses[:, None] * axes[images]])


def _is_rotation(part: _Part, places: FloatArray, axes: FloatArray) -> bool:
    """Whether a proper rotation does it: the best one, by the singular value method."""
    before, after = np.vstack([places, axes]), _carried(part, places, axes)
    left, _, right = np.linalg.svd(after.T @ before)
    proper = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return bool(np.max(np.abs(before @ proper.T - after)) < 10 * EQUAL)


def _code(orders: IntArray, flips: BoolArray, n: int) -> npt.NDArray[np.int64]:
    powers = (2 * n) ** np.arange(n - 1, -1, -1, dtype=np.int64)
    return np.asarray((2 * orders + flips) @ powers)
