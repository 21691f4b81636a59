"""How finely a workspace is looked at, and how much is tried for the best limits."""

from __future__ import annotations

from dataclasses import dataclass

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.nlp.arrays import real_number, whole_number

# Half a turn, in degrees: the most that steps and widths can be.
_HALF_TURN = 180.0
_MOST_STARTS = 10**6
_MOST_HALVINGS = 12


@dataclass(frozen=True, repr=False)
class WorkspaceSearch(Brief):
    """How finely a workspace is looked at, and how much is tried for the best limits.

    Parameters
    ----------
    voxel
        Edge of the grid's cells, in metres; by default a fiftieth of the sum of the links, or
        of the travel where there are none, or a twelfth with an orientation in space or joints
        to spare.
    slice_degrees
        Step between the angles at which a joint may lock.
    least_width_degrees
        Least width of limits that are chosen.
    starts
        Starts of the search for limits.
    seed
        Random seed of the points that are sampled, of inverse kinematics, and of the search for
        limits; reproducible across machines.
    """

    voxel: float | None = None
    slice_degrees: float = 5.0
    least_width_degrees: float = 10.0
    starts: int = 4
    seed: int = 0

    def __post_init__(self) -> None:
        if self.voxel is not None:
            real_number("voxel", self.voxel, "a length above 0, in metres", 1e-300)
        allowed = "a number of degrees above 0, at most 180"
        for name in ("slice_degrees", "least_width_degrees"):
            real_number(name, getattr(self, name), allowed, 1e-9, _HALF_TURN)
        whole_number("starts", self.starts, 1, _MOST_STARTS)
        whole_number("seed", self.seed, 0)


@dataclass(frozen=True, repr=False)
class CubeSearch(Brief):
    """How small the cubes are that are proved to be kept.

    Parameters
    ----------
    finest
        Edge of the smallest cubes, in metres; by default a hundredth of the sum of the links.
    halvings
        How often cubes that are not proved are halved.
    """

    finest: float | None = None
    halvings: int = 3

    def __post_init__(self) -> None:
        if self.finest is not None:
            real_number("finest", self.finest, "a length above 0, in metres", 1e-300)
        whole_number("halvings", self.halvings, 0, _MOST_HALVINGS)
