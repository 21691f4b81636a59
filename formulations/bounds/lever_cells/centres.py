"""Centres: unit tight frames, and their images under orders and signs of the columns.

The order of an arm's joints and the directions of their axes are conventions. So frames that
differ by the order or by signs of their columns count as one: a centre stands for all its
5040·64 images (both signs of all columns give one projection P = WᵀW).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.bounds.lever_cells.charts import Chart, tight_chart
from lockedjoint.nlp.arrays import FloatArray

#: Numbers that serve for a first choice only.
RoughArray: TypeAlias = npt.NDArray[np.float32]

#: All orders of seven columns, 5040×7.
ORDERS = np.array(list(itertools.permutations(range(7))))
#: All signs of seven columns, but for a common one, 64×7.
SIGNS = np.array([(1.0, *signs) for signs in itertools.product((1.0, -1.0), repeat=6)])
#: Rows of the places in the upper triangle of a 7×7 matrix, 21.
ROWS = np.triu_indices(7, 1)[0]
#: Columns of these places.
COLS = np.triu_indices(7, 1)[1]
#: What the diagonals add to tr P P' of tight frames: 7 (3/7)².
DIAGONAL = 9.0 / 7.0
#: Squared distance 3 − tr P P' below which an image is the centre itself.
SAME = 1e-5
#: Distance, in radii of the ball around a centre, beyond which images are left out.
REACH = 2.1
#: Number of images that are looked at.
NEAREST = 600


def upper(matrices: FloatArray) -> FloatArray:
    """Return the upper triangles (…,21), without diagonals, of matrices (…,7,7)."""
    return np.asarray(matrices[..., ROWS, COLS])


@dataclass(frozen=True)
class HalfSpaces:
    """Half spaces tr P X_i > 0: frames nearer to an image i of a centre than to a centre c.

    Attributes
    ----------
    X : P_i − P_c, (M,7,7); zero on the diagonal.
    """

    X: FloatArray

    @cached_property
    def rough(self) -> RoughArray:
        """The upper triangles, doubled, (21,M): for a first choice only."""
        return np.asarray((2 * upper(self.X).T).astype(np.float32))


@dataclass(frozen=True)
class Centres:
    """Centres with balls of one radius; a frame P is nearest to where tr P P_c is greatest.

    Attributes
    ----------
    radius : the radius R: the ball of a centre holds all frames with tr P P_c ≥ 3 − R².
    charts : a chart of each ball.
    P : the projections of the centres, (C,7,7).
    """

    radius: float
    charts: tuple[Chart, ...]
    P: FloatArray

    @classmethod
    def of_frames(cls, frames: Iterable[FloatArray], radius: float) -> Centres:
        """Return as centres the tight frames next to these, of shape (3,7) each."""
        charts = tuple(tight_chart(W, radius**2) for W in frames)
        return cls(radius, charts, np.array([chart.W.T @ chart.W for chart in charts]))

    def __len__(self) -> int:
        """Return the number of centres."""
        return len(self.charts)

    @property
    def level(self) -> float:
        """The trace tr P P_c on the sphere of a ball."""
        return 3 - self.radius**2

    @cached_property
    def _ordered(self) -> RoughArray:
        """The upper triangles of all P in all orders, (5040·C,21)."""
        images = self.P[:, ORDERS[:, ROWS], ORDERS[:, COLS]]
        return np.asarray(images.reshape(-1, 21).astype(np.float32))

    def squared_distances(self, P: FloatArray) -> RoughArray:
        """Return 3 − tr P P_i for all images i, in single precision, (5040·C,64)."""
        signs = (SIGNS[:, ROWS] * SIGNS[:, COLS]).astype(np.float32)
        products = self._ordered * upper(P).astype(np.float32)
        return np.asarray(np.float32(3 - DIAGONAL) - 2 * (products @ signs.T))

    def near(self, a: int, most: int = NEAREST) -> HalfSpaces:
        """Return half spaces of at most so many images, those nearest to centre a.

        Any choice of images is valid; this one, in single precision, should be a good one.
        """
        squared = self.squared_distances(self.P[a]).ravel()
        keep = np.flatnonzero((squared > SAME) & (squared < (REACH * self.radius) ** 2))
        keep = keep[np.argsort(squared[keep], kind="stable")[:most]]
        ordered, signs = keep // len(SIGNS), SIGNS[keep % len(SIGNS)]
        b, order = ordered // len(ORDERS), ORDERS[ordered % len(ORDERS)]
        images = self.P[b[:, None, None], order[:, :, None], order[:, None, :]]
        return HalfSpaces(images * signs[:, :, None] * signs[:, None, :] - self.P[a])
