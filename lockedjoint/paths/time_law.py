"""How far along a way the arm is at each time: what TOPP-RA finds, made smooth.

TOPP-RA's speed along the way has corners, at which accelerations jump. The mean of its place
over a window of time has none. With two windows, one after the other, the jerk is finite and
has no jumps either. The way itself is the same; it takes as much longer as windows are wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """A way, and the place on it at each time.

    Attributes
    ----------
    way
        Configurations by place, a spline.
    place
        Places by time, from rest to rest: a polynomial of degree two between two times.
    """

    way: CubicSpline
    place: PPoly

    @classmethod
    def of(cls, way: CubicSpline, grid: FloatArray, speeds: FloatArray) -> TimeLaw:
        """Return the law of constant accelerations between places (K,) with speeds (K,)."""
        spans = 2 * np.diff(grid) / (speeds[:-1] + speeds[1:])
        rates = np.diff(speeds) / spans
        times = np.concatenate([[0.0], np.cumsum(spans)])
        return cls(way, PPoly(np.stack([rates / 2, speeds[:-1], grid[:-1]]), times))

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.place.x[-1])

    def smoothed(self, *windows: float) -> SmoothLaw:
        """Return the law with the place's mean over two windows of time, seconds."""
        first, last = self.place.x[[0, -1]]
        around = sum(windows)
        ends = self.place(np.array([first, last]))
        still = np.stack([np.zeros(2), np.zeros(2), ends])
        values = np.column_stack([still[:, :1], self.place.c, still[:, 1:]])
        times = np.concatenate([[first - around], self.place.x, [last + around]])
        return SmoothLaw(self.way, PPoly(values, times).antiderivative(2), windows, ends)


@dataclass(frozen=True, eq=False)
class SmoothLaw:
    """A way, and the place on it at each time, which is smooth.

    Attributes
    ----------
    way
        As in `TimeLaw`.
    integral
        The integral of the integral of the place before it was smooth.
    windows
        Widths of the two windows, seconds.
    ends
        Places at rest, shape (2,).
    """

    way: CubicSpline
    integral: PPoly
    windows: tuple[float, ...]
    ends: FloatArray

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.integral.x[-1])

    def states(self, times: FloatArray) -> FloatArray:
        """Return positions and their first three derivatives, shape (4, N, n)."""
        place = self.places(times)
        speed, rate, jerk = (self._place(times, order) for order in range(1, 4))
        q, slope, bend, twist = (self.way(place, order) for order in range(4))
        speed, rate, jerk = speed[:, None], rate[:, None], jerk[:, None]
        return np.stack(
            [
                q,
                slope * speed,
                bend * speed**2 + slope * rate,
                twist * speed**3 + 3 * bend * speed * rate + slope * jerk,
            ]
        )

    def places(self, times: FloatArray) -> FloatArray:
        """Return places on the way, shape (N,)."""
        return np.clip(self._place(times, 0), *self.ends)

    def _place(self, times: FloatArray, order: int) -> FloatArray:
        """Return a derivative of the place, shape (N,)."""
        one, two = self.windows
        parts = (times, times - one, times - two, times - one - two)
        ahead, first, second, behind = (self.integral(part, order) for part in parts)
        return np.asarray((ahead - first - second + behind) / (one * two))
