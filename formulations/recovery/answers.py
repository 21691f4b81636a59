"""The three answers to a failure: a trajectory, impossible, or not found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar, TypeAlias

from formulations.io.objects import Brief
from formulations.paths.timing import TimedTrajectory
from formulations.recovery.unreachable import ReachProof


@dataclass(frozen=True)
class NearestPose:
    """The configuration found nearest to a goal, and what is missing there.

    Attributes
    ----------
    configuration
        Of the whole arm, radians and metres by joint.
    position
        Of the tip, metres.
    distance, angle
        What is missing beyond the tolerances, metres and radians.
    """

    configuration: Mapping[str, float]
    position: tuple[float, ...]
    distance: float
    angle: float


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

    nearest: NearestPose | None
    brake: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    share: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Recovered(Brief):
    """A trajectory to the goal, which passed the check.

    Attributes
    ----------
    trajectory
        Of all joints of the arm, locked ones included.
    corners
        At which the joints stop on the way.
    tried
        What was tried, in sentences.
    """

    verdict: ClassVar[str] = "trajectory"
    trajectory: TimedTrajectory
    corners: int
    tried: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        run = self.trajectory.to_dict()
        return {"verdict": self.verdict, "tried": list(self.tried), "trajectory": run}


@dataclass(frozen=True, eq=False, repr=False)
class Impossible(Brief):
    """No configuration within the limits that are left has the tool at the goal.

    Attributes
    ----------
    proof
        Why, in floating point with a margin; `check_proof` checks it with all rounding bounded.
    sample
        Of a path, the sample that is out of reach.
    help
        What can be done instead.
    tried
        What was tried, in sentences.
    """

    verdict: ClassVar[str] = "impossible, proved"
    proof: ReachProof
    help: Help
    tried: tuple[str, ...]
    sample: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "verdict": self.verdict,
            "tried": list(self.tried),
            "sample": self.sample,
            "help": asdict(self.help),
            "proof": self.proof.to_dict(),
        }


@dataclass(frozen=True, eq=False, repr=False)
class NotFound(Brief):
    """Nothing was found, and nothing is proved.

    Attributes
    ----------
    help
        What can be done instead.
    tried
        What was tried, in sentences.
    """

    verdict: ClassVar[str] = "not found"
    help: Help
    tried: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "verdict": self.verdict,
            "tried": list(self.tried),
            "help": asdict(self.help),
        }


Recovery: TypeAlias = Recovered | Impossible | NotFound
