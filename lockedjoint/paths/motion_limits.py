"""How fast the joints of an arm may move, and how suddenly.

Numbers are one for each of the n free joints, from base to tip. Revolute joints have them in
rad/s, rad/s² and rad/s³, prismatic ones in m/s, m/s² and m/s³.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import FloatArray, as_floats, finite_vector
from lockedjoint.nlp.errors import InputError

#: TOPP-RA needs these modules.
TOPPRA = ("toppra", "toppra.algorithm", "toppra.constraint")
# Limits of velocity, acceleration and jerk, in the units above, may not be smaller, nor larger
# than its inverse: squares and quotients of them then neither overflow nor underflow.
_SMALLEST_LIMIT = 1e-10


class Shares(NamedTuple):
    """How much of its limits a motion uses, without unit: 1 is all, more is too fast.

    Each is the largest of all joints.
    """

    velocity: float
    acceleration: float
    jerk: float  #: It is 0 without limits of jerk.


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest velocities, accelerations and jerks of joints, shape (n,) each, above 0.

    Without limits of jerk accelerations are as sudden as the points of a trajectory can say.
    """

    velocity: FloatArray  #: rad/s or m/s.
    acceleration: FloatArray  #: rad/s² or m/s².
    jerk: FloatArray | None = None  #: rad/s³ or m/s³.

    @classmethod
    def of(
        cls,
        chain: Chain,
        acceleration: Sequence[float],
        velocity: Sequence[float] | None = None,
        jerk: Sequence[float] | None = None,
    ) -> Self:
        """Return those of an arm; velocities are by default those of its file.

        Raises
        ------
        InputError
            If a limit is missing or not above 0.
        """
        fastest = [joint.velocity for joint in chain.joints] if velocity is None else velocity
        for name, limit in zip(chain.names, fastest, strict=False):
            if limit is None or not np.isfinite(limit):
                allowed = f"one for {name}, which has none in its file"
                raise InputError("velocity limits", "missing", allowed)
        return cls(
            _positive("velocity limits", fastest, len(chain.names)),
            _positive("acceleration limits", acceleration, len(chain.names)),
            None if jerk is None else _positive("jerk limits", jerk, len(chain.names)),
        )

    def shares(self, largest: Sequence[FloatArray]) -> Shares:
        """Return velocity, acceleration and jerk as shares of their limits; jerk 0 without.

        Given are the largest sizes of the three, shape (n,) each.
        """
        velocity, acceleration, jerk = largest
        return Shares(
            float(np.max(velocity / self.velocity)),
            float(np.max(acceleration / self.acceleration)),
            0.0 if self.jerk is None else float(np.max(jerk / self.jerk)),
        )


def require_toppra() -> None:
    """Raise MissingLibraryError, which says how to install toppra, if it is not installed."""
    library(*TOPPRA)


def for_each(name: str, given: Sequence[float] | float, joints: int) -> FloatArray:
    """Return a number for each joint, shape (joints,), from one for each or one for all.

    The name is for errors.
    """
    values = np.atleast_1d(as_floats(name, given))
    if values.ndim == 1 and len(values) not in (1, joints):
        raise InputError(
            name, f"{len(values)} numbers", f"{joints}, one a joint, or one for all"
        )
    return finite_vector(
        name, np.repeat(values, joints) if len(values) == 1 else values, joints
    )


def _positive(name: str, given: Sequence[float | None], size: int) -> FloatArray:
    """Return limits as an array, (size,); InputError, with their name, if any is 0 or less."""
    limits = finite_vector(name, np.asarray(given, dtype=float), size)
    if not np.all((limits >= _SMALLEST_LIMIT) & (limits <= 1 / _SMALLEST_LIMIT)):
        allowed = f"numbers above 0, from {_SMALLEST_LIMIT:g} to {1 / _SMALLEST_LIMIT:g}"
        raise InputError(name, limits.tolist(), allowed)
    return limits
