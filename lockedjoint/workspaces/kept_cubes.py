"""Cubes of positions that are kept for certain: their size, and a file of them.

What comes in: the cubes that `bisection` has proved, or a file of some. What goes out:
`KeptCubes`, which know the arm and its limits, so that a file says all that a proof needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from lockedjoint.formulations.io.files import read_bytes
from lockedjoint.kinematics.chain import Chain, ChainJoint
from lockedjoint.kinematics.geometry import BoolArray, IntArray, homogeneous
from lockedjoint.kinematics.serial_chain import (
    Ranges,
    chain_about_z,
    frames_of,
    is_planar,
    tip_of,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.workspaces.workspace import check_limits

# A file has these arrays, those of the joints first. Their shapes are in letters: n joints, k
# cubes, m dimensions.
_SHAPES = {
    "placement": "n44",
    "prismatic": "n",
    "lower": "n",
    "upper": "n",
    "tip": "3",
    "limits": "n2",
    "centre": "km",
    "half_width": "k",
}
# A cube may be off its grid by this share of its edge, and the binary logarithm of a ratio of
# half widths off a whole number by this much. It allows for rounding: more would let cubes
# overlap by that share, and 0 would refuse files that are right.
_OFF_GRID_SHARE = 1e-9
# Entries of a rotation may be wrong by this: more would accept matrices that stretch.
_ROTATION_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class KeptCubes:
    """Cubes of positions that are kept for certain, in the frame of joint 1.

    Attributes
    ----------
    arm, limits
        The arm, and the artificial limits of its joints, in radians or metres.
    centre, half_width
        Middles, shape (k, m), and half widths, (k,), in metres. No two overlap.
    """

    arm: Chain
    limits: Ranges
    centre: FloatArray
    half_width: FloatArray

    @property
    def size(self) -> float:
        """Area or volume of all cubes, in m² or m³: a lower bound of what is kept."""
        return float(np.sum((2 * self.half_width) ** self.centre.shape[1]))

    @staticmethod
    def joined(parts: Sequence[KeptCubes]) -> KeptCubes:
        """Return the cubes of all parts, of which there is one at least, of the same arm."""
        centre = np.concatenate([part.centre for part in parts])
        half_width = np.concatenate([part.half_width for part in parts])
        return replace(parts[0], centre=centre, half_width=half_width)

    def __getitem__(self, which: BoolArray | IntArray) -> KeptCubes:
        """Return some of the cubes: a truth value for each, (k,), or the numbers of some."""
        return replace(self, centre=self.centre[which], half_width=self.half_width[which])

    def to_bytes(self) -> bytes:
        """Return an NPZ file of arrays, which says all that a proof needs.

        Of the joints, from base to tip: ``placement`` in the frame before, shape (n, 4, 4), of
        the first in the base; ``prismatic``, physical limits ``lower`` and ``upper``, and
        artificial ``limits``, (n, 2). The ``tip`` in the last frame, (3,). The cubes'
        ``centre`` and ``half_width``.
        """
        joints, file = self.arm.joints, BytesIO()
        np.savez_compressed(
            file,
            placement=frames_of(self.arm),
            prismatic=[joint.prismatic for joint in joints],
            lower=[joint.lower for joint in joints],
            upper=[joint.upper for joint in joints],
            tip=tip_of(self.arm),
            limits=self.limits,
            centre=self.centre,
            half_width=self.half_width,
        )
        return file.getvalue()

    @classmethod
    def read(cls, path: Path) -> KeptCubes:
        """Read such a file; FileError if it is something else."""
        allowed = "cubes that `prove-workspace --out` wrote"
        try:
            with np.load(BytesIO(read_bytes(path)), allow_pickle=False) as file:
                given = {name: np.array(file[name], dtype=float) for name in _SHAPES}
        except (ValueError, KeyError, OSError, EOFError, BadZipFile) as error:
            raise FileError("file", str(path), allowed) from error
        sizes: dict[str, int] = {}
        for name, shape in _SHAPES.items():
            array = given[name]
            fits = array.ndim == len(shape) and bool(np.all(np.isfinite(array)))
            for letter, length in zip(shape, array.shape, strict=False):
                fits &= letter in (str(length), "n", "k", "m")
                fits &= sizes.setdefault(letter, length) == length
            if not fits or array.size == 0:
                raise FileError("file", str(path), f"{allowed}; {name} is not as there")
        rotation = given["placement"][:, :3, :3]
        squares = np.swapaxes(rotation, 1, 2) @ rotation - np.eye(3)
        turned = np.max(np.abs(squares)) < _ROTATION_TOLERANCE and np.all(
            np.linalg.det(rotation) > 0
        )
        if not turned or not np.all(given["half_width"] > 0):
            raise FileError("file", str(path), f"{allowed}; with rotations and widths above 0")
        joints = zip(*(given[name] for name in ("prismatic", "lower", "upper")), strict=True)
        arm = chain_about_z(
            [
                ChainJoint(f"joint_{k}", bool(slides), low, high)
                for k, (slides, low, high) in enumerate(joints, 1)
            ],
            list(given["placement"]),
            homogeneous(np.eye(3), given["tip"]),
        )
        if sizes["m"] != (2 if is_planar(arm) else 3):
            raise FileError("file", str(path), f"{allowed}; in the arm's dimension")
        limits = tuple((low, high) for low, high in given["limits"].tolist())
        found = cls(arm, limits, given["centre"], given["half_width"])
        try:
            check_limits(arm, limits)
        except InputError as error:
            raise FileError("file", str(path), f"{allowed}; {error}") from error
        if not _apart(found):
            raise FileError("file", str(path), f"{allowed}; no two of which overlap")
        return found

    def __repr__(self) -> str:
        """Say in one line how much is kept for certain."""
        unit = "m²" if self.centre.shape[1] == 2 else "m³"
        size = f"{self.size:.4g} {unit}"
        return f"<KeptCubes: at least {size} in {len(self.half_width)} cubes, proved>"


def on_one_grid(cubes: KeptCubes) -> bool:
    """Return whether cubes are those of a grid at the origin, halved again and again."""
    halved = np.log2(cubes.half_width.max() / cubes.half_width)
    places = cubes.centre / (2 * cubes.half_width[:, None])
    off = np.concatenate([halved - np.round(halved), np.ravel(places - np.floor(places) - 0.5)])
    return bool(np.all(np.abs(off) <= _OFF_GRID_SHARE))


def _apart(cubes: KeptCubes) -> bool:
    """Return whether no two cubes overlap, of one grid."""
    if not on_one_grid(cubes):
        return False
    # A cube of this half width overlaps no other as large or smaller if the cells of both, in
    # the grid of this half width, differ.
    for half_width in np.unique(cubes.half_width):
        cells = np.floor(cubes.centre[cubes.half_width <= half_width] / (2 * half_width))
        own = cubes.half_width[cubes.half_width <= half_width] == half_width
        taken = set(map(tuple, cells[own].tolist()))
        if len(taken) != own.sum() or not taken.isdisjoint(map(tuple, cells[~own].tolist())):
            return False
    return True
