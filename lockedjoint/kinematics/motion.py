"""Displacements about and along axes: what chains and whole robots are made of."""

from dataclasses import dataclass
from typing import TypeAlias

from lockedjoint.nlp.arrays import FloatArray

#: A transform has the rows of a homogeneous 4×4 matrix.
Transform: TypeAlias = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Motion:
    """A displacement about, or along, an axis by ``multiplier``·q[variable] + ``offset``."""

    placement: Transform  #: The frame of the motion in the one that the motion before moves.
    axis: tuple[float, float, float]  #: Unit vector, in the frame after the placement.
    prismatic: bool
    variable: int  #: The joint of the chain that drives it, by number.
    multiplier: float
    offset: float


#: Bodies 1, 2, … come parents first: each has the number of the body before its joint, and the
#: joint's motion. Body 0 does not move. Each body of a chain comes right after its parent.
Bodies: TypeAlias = tuple[tuple[int, Motion], ...]


def frozen(matrix: FloatArray) -> Transform:
    """Return a matrix as rows that cannot be changed."""
    return tuple(tuple(row) for row in matrix.tolist())
