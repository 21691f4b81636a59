"""What is stated of joints with angles in degrees, and how it becomes radians."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lockedjoint.nlp.arrays import as_floats

#: Units of angles have these factors.
ANGLES: Mapping[str, float] = {"rad": 1.0, "deg": math.pi / 180}
# Angles beyond this can hardly be meant in radians.
_TWO_TURNS_RAD = 4 * math.pi


@dataclass(frozen=True, eq=False, repr=False)
class InDegrees:
    """A configuration, or positions or limits by joint, whose angles are in degrees.

    Travels of prismatic joints stay in metres. Files and named states keep their own units.

    Parameters
    ----------
    stated
        What a function takes in radians: ``lj.measure(robot, lj.InDegrees([0, 45, 90]))``, or
        ``lj.workspace(robot, limits=lj.InDegrees({"elbow": (-45, 45)}))``.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.measure("example", lj.InDegrees([0, 20, 50, 60, 0, 40, 0])).worst_case_joints
    ('wrist_flex',)
    """

    stated: Any

    def __repr__(self) -> str:
        """Say what is stated, and the unit."""
        return f"{self.stated!r} in degrees"


class FromDegrees(float):
    """An angle in radians that was stated in degrees: it was meant so, however large it is."""

    __slots__ = ()


def far_angles(
    name: str, radians: Sequence[float], remedy: str = "--angles deg states them"
) -> tuple[str, ...]:
    """Return a sentence on angles that may be degrees, and the remedy, if there are some.

    The name is of the option or the argument.
    """
    far = [
        f"{angle:g}"
        for angle in radians
        if abs(angle) > _TWO_TURNS_RAD and not isinstance(angle, FromDegrees)
    ]
    if not far:
        return ()
    return (
        f"Angles of {name} beyond two turns (±4π rad) may be degrees ({remedy}):"
        f" {', '.join(far)}.",
    )


def in_radians(stated: Any, slides: Collection[str], names: Sequence[str] = ()) -> Any:
    """Return what is stated of joints in radians and metres, other than of joints that slide.

    A mapping from joints to numbers, None, or pairs of numbers; or a row of numbers for joints
    of some names. A row of another length is returned as it is: it is refused elsewhere.
    """
    if isinstance(stated, Mapping):
        return {
            joint: value if value is None or joint in slides else _times(joint, value)
            for joint, value in stated.items()
        }
    values = as_floats("q", stated)
    if values.shape != (len(names),):
        return stated
    return values * [1.0 if name in slides else ANGLES["deg"] for name in names]


def _times(joint: str, value: Any) -> Any:
    """Return a number or a pair of numbers in radians."""
    values = as_floats(f"degrees of {joint}", value) * ANGLES["deg"]
    radians = [FromDegrees(angle) for angle in np.ravel(values).tolist()]
    return radians[0] if values.ndim == 0 else tuple(radians)
