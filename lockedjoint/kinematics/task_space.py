"""A task: the directions of the tool's velocity that the Jacobian has rows for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.nlp.errors import InputError, entries_of, of_kind, one_of

# A tip has these directions of motion: linear ones first, then angular ones.
DIRECTIONS = ("vx", "vy", "vz", "wx", "wy", "wz")
# These names stand for several directions.
GROUPS = {"all": DIRECTIONS, "position": DIRECTIONS[:3], "orientation": DIRECTIONS[3:]}
Frame: TypeAlias = Literal["base", "tip"]


@dataclass(frozen=True, repr=False)
class TaskSpace(Brief):
    """The directions of the tip's velocity that J has rows for.

    Parameters
    ----------
    directions
        Some of `DIRECTIONS`, each once: linear (v) and rotational (w) velocities.
    frame
        The frame along whose axes they are, ``"base"`` or ``"tip"``. If they are all three v,
        all three w, or both, the frame makes no difference to singular values.

    Raises
    ------
    InputError
        If no direction is given, one is unknown or repeated, or there is no such frame.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.TaskSpace.parse("position").directions
    ('vx', 'vy', 'vz')
    >>> lj.TaskSpace(("vx", "vy"), frame="tip").frame
    'tip'
    """

    directions: tuple[str, ...] = DIRECTIONS
    frame: Frame = "base"

    def __post_init__(self) -> None:
        allowed = f"some of {', '.join((*GROUPS, *DIRECTIONS))}, with commas, each once"
        given = tuple(map(str, entries_of("task", self.directions, allowed)))
        if not given or not set(given) <= set(DIRECTIONS) or len(set(given)) < len(given):
            raise InputError("task", ",".join(given), allowed)
        object.__setattr__(self, "directions", given)
        one_of("frame", self.frame, ("base", "tip"))

    @classmethod
    def parse(cls, text: str, frame: str = "base") -> TaskSpace:
        """Read names of directions or groups of them, separated by commas.

        After ``tip:`` they are along the tip's axes, after ``base:`` along those of the base.
        """
        of_kind("task", text, str, "names of directions, with commas")
        stated, colon, rest = text.partition(":")
        if colon:
            frame, text = stated.strip(), rest
        names = [name.strip() for name in text.split(",")]
        directions = [direction for name in names for direction in GROUPS.get(name, (name,))]
        return cls(tuple(directions), frame)  # type: ignore[arg-type]

    @property
    def rows(self) -> list[int]:
        """Their rows in the full Jacobian (v; ω)."""
        return [DIRECTIONS.index(name) for name in self.directions]

    @property
    def linear(self) -> bool:
        """Whether there are linear directions."""
        return any(name.startswith("v") for name in self.directions)

    @property
    def mixed(self) -> bool:
        """Whether there are both linear and rotational directions."""
        return len({name[0] for name in self.directions}) == 2
