"""How to look for a trajectory along a path, and how fast a controller may run it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.nlp.errors import InputError, a_function, one_of

#: A timed trajectory blends at waypoints or stops there.
CORNERS = ("blend", "stop")
# Searches with more samples are refused: no path needs them, and the memory is for so many.
_MOST_SAMPLES = 2000
# Searches with more tracks are refused, for the same reason.
_MOST_TRACKS = 10_000


@dataclass(frozen=True, repr=False)
class PathSearch(Brief):
    """How to look for a trajectory.

    Parameters
    ----------
    samples
        Samples of the path at which failures are tried, every waypoint among them.
    duration
        Duration in seconds of the whole path, if the waypoints have no times.
    tracks
        Number of candidate trajectories that the search combines, for arms with several joints
        to spare. A 24th of this number is tried beside the best sequence.
    rounds
        How often trajectories beside the best sequence are added.
    seed
        Random seed; reproducible across machines.
    progress
        A function that is told what is being done.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.PathSearch(samples=30, duration=5.0).samples
    30
    """

    samples: int = 60
    duration: float = 10.0
    tracks: int = 240
    rounds: int = 3
    seed: int = 0
    progress: Callable[[str], None] = lambda _: None

    def __post_init__(self) -> None:
        from lockedjoint.nlp.arrays import check_length, whole_number

        whole_number("samples", self.samples, 3, _MOST_SAMPLES)
        whole_number("tracks", self.tracks, 1, _MOST_TRACKS)
        whole_number("rounds", self.rounds, 0)
        whole_number("seed", self.seed, 0)
        check_length("duration", self.duration)
        a_function("progress", self.progress)


@dataclass(frozen=True, repr=False)
class Timing(Brief):
    """How fast a controller may run a trajectory.

    Parameters
    ----------
    acceleration
        Largest accelerations of the joints, rad/s² or m/s², or one for all. With it the
        trajectory is timed, from rest to rest. Needs toppra.
    velocity
        Largest velocities of the joints, rad/s or m/s, or one for all; by default those of the
        file.
    jerk
        Largest jerks of the joints, rad/s³ or m/s³, or one for all; by default none:
        accelerations change as suddenly as the points of the trajectory can say.
    corners
        Whether waypoints are passed on a smooth curve through all samples, blend, or the arm
        rests at each, stop.
    step
        Time in seconds between two points of the timed trajectory, about. There are 200 points
        at least, and at most 10 000: of slow joints they are farther apart.
    """

    acceleration: Sequence[float] | float | None = None
    velocity: Sequence[float] | float | None = None
    jerk: Sequence[float] | float | None = None
    corners: str = "blend"
    step: float = 0.01

    def __post_init__(self) -> None:
        one_of("corners", self.corners, CORNERS)
        for name in ("velocity", "jerk"):
            if self.acceleration is None and getattr(self, name) is not None:
                raise InputError(name, "given alone", "one with an acceleration")
        if self.acceleration is None and self.corners != CORNERS[0]:
            raise InputError("corners", self.corners, f"{CORNERS[0]}, without an acceleration")
