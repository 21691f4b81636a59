"""From where an arm stands to the beginning of its path: a way of the joints.

Configurations have the shape (n,), n joints in radians, those of sliders in metres.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from lockedjoint.clearance.link_clearance import Closest, LinkClearance
from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.connecting import Connector, SearchLimit

# RRT-Connect looks for a way around links with at most this number of random samples. More find
# ways through narrower gaps; a search that finds none takes longer, about 10 s with a cell.
_MOST_SAMPLES = 400
# Configurations are the same if no joint differs by as much as this: far more than rounding,
# and far less than a joint can be told to move.
_SAME_M_OR_RAD = 1e-9


class NoApproachError(InputError):
    """A configuration from which no way to the beginning of a path was found."""

    exit_status: ClassVar[int] = 1


@dataclass(frozen=True, eq=False)
class Approach:
    """A way of the joints from where an arm stands to the beginning of its path.

    Attributes
    ----------
    configurations
        Corners, from where the arm stands to the first sample of the path, shape (K, n); the
        joints move evenly from one to the next. One if the arm is there.
    closest
        Where links have to stay apart: the nearest two anywhere on it.
    notes
        What was left aside of where the arm stands, in sentences.
    """

    configurations: FloatArray
    closest: Closest | None = None
    notes: tuple[str, ...] = ()

    @property
    def largest_motion(self) -> float:
        """The most that a joint moves in all, radians or metres."""
        moves = np.abs(np.diff(self.configurations, axis=0))
        return float(np.max(np.sum(moves, axis=0)))

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "configurations": self.configurations.tolist(),
            "largest_motion": self.largest_motion,
            "collisions": "not checked" if self.closest is None else "none",
            "closest": self.closest and asdict(self.closest),
        }

    def __str__(self) -> str:
        """Say in words how the arm gets there."""
        corners = len(self.configurations) - 2
        if corners < 0:
            return "the arm stands at the first waypoint"
        moved = f"no joint moves by more than {self.largest_motion:.3g} (rad or m)"
        if not corners:
            kind = "a straight way of the joints"
        else:
            ways = "corner" if corners == 1 else "corners"
            kind = (
                f"a way with {corners} {ways}, because links come too near on the straight one"
            )
        checked = "collisions not checked" if self.closest is None else str(self.closest)
        return f"{kind}; {moved}; {checked}"


def whole_turns(chain: Chain, start: FloatArray, first: FloatArray) -> FloatArray:
    """Return whole turns, rad, which added to `first` bring it nearest to `start`, shape (n,).

    Only joints without limits, after a turn of which all is as it was, are turned: by the
    multiple of 2π next to start - first, so that they move by at most half a turn.
    """
    lower, upper = chain.limits
    turning = chain.turning & np.isneginf(lower) & np.isposinf(upper)
    turn = 2 * np.pi
    return np.where(turning, turn * np.round((start - first) / turn), 0.0)


def approach(
    chain: Chain,
    start: FloatArray,
    first: FloatArray,
    clearance: LinkClearance | None = None,
    seed: int = 0,
    notes: tuple[str, ...] = (),
) -> Approach:
    """Return a way from where an arm stands to the beginning of its path.

    Parameters
    ----------
    chain
        The joints, within whose limits the way stays.
    start, first
        Where the arm stands, within its limits and with links apart, and the first
        configuration of the path, shape (n,).
    clearance
        What links keep from each other and from obstacles all the way; by default they may
        touch. Where the straight way does not keep it, RRT-Connect looks for another.
    seed
        Of that search.
    notes
        On where the arm stands.

    Raises
    ------
    NoApproachError
        If no way was found with `_MOST_SAMPLES` random samples.
    MissingLibraryError
        If ompl, which looks for ways around links, is needed and not installed.
    """
    connector = Connector(chain, clearance)
    if np.max(np.abs(first - start)) < _SAME_M_OR_RAD:
        corners: FloatArray | None = first[None]
    else:
        corners = connector.way(start, first[None], SearchLimit(samples=_MOST_SAMPLES), seed)
    if corners is None:
        allowed = (
            "a configuration from which RRT-Connect finds a way to the first waypoint with"
            f" {_MOST_SAMPLES} samples, with links apart"
        )
        raise NoApproachError("q", "without a way to the first waypoint", allowed)
    motion = connector.motion
    closest = None if motion is None else motion.closest_along(corners)
    return Approach(corners, closest, notes)
