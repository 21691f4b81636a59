"""The answer to a failure: a trajectory, impossible, or not found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from lockedjoint.clearance.link_clearance import Closest
from lockedjoint.formulations.io.objects import Brief
from lockedjoint.paths.timing import TimedTrajectory
from lockedjoint.recovery.unreachable import ReachProof


@dataclass(frozen=True)
class NearestPose:
    """The configuration found nearest to a goal, and what is missing there."""

    q: Mapping[str, float]  #: The whole arm's, radians and metres by joint.
    position: tuple[float, ...]  #: The tip's, metres.
    distance: float  #: Distance from the goal beyond the tolerance, metres.
    angle: float  #: The same, radians.


@dataclass(frozen=True)
class Help:
    """What an operator can do where a goal is not reached.

    Attributes
    ----------
    nearest
        The nearest pose that was found.
    brake
        Of each joint that has locked: positions, in steps over its range, where the goal
        would have been within reach had it locked there, the others as they have failed.
    share
        Of a path, the share of its samples, from the first on, that was done; 0 of a pose.
    """

    nearest: NearestPose
    brake: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    share: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Recovery(Brief):
    """The answer to a failure.

    Attributes
    ----------
    verdict
        ``"trajectory"``, which passed the check; ``"impossible, proved"``: no configuration
        within the limits that are left has the tool at the goal, all rounding errors bounded;
        ``"impossible, numerical"``: the same as computed in floating point; or
        ``"not found"``: nothing is known.
    tried
        What was tried, in sentences.
    trajectory
        Of all joints of the arm, locked ones included.
    proof
        That the goal is out of reach.
    sample
        Of a path, the sample that is out of reach.
    help
        What can be done instead, where there is no trajectory.
    notes
        What was left aside of the configuration, in sentences.
    closest
        Where links have to stay apart: the nearest two anywhere on the trajectory.
    """

    verdict: str
    tried: tuple[str, ...]
    trajectory: TimedTrajectory | None = None
    proof: ReachProof | None = None
    sample: int | None = None
    help: Help | None = None
    notes: tuple[str, ...] = ()
    closest: Closest | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        plain: dict[str, Any] = {"verdict": self.verdict, "tried": list(self.tried)}
        plain["notes"] = list(self.notes)
        if self.trajectory is not None:
            plain["trajectory"] = self.trajectory.to_dict()
        if self.closest is not None:
            plain["closest"] = asdict(self.closest)
        if self.help is not None:
            plain |= {"sample": self.sample, "help": asdict(self.help)}
        if self.proof is not None:
            plain["proof"] = self.proof.content
        return plain
