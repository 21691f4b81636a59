"""What a controller does between the points of a trajectory: a polynomial of degree five.

ROS's joint_trajectory_controller goes from point to point so that position, velocity and
acceleration are those of both; so does everything that reads all columns of our files. Limits
hold between points only if they hold for these polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.nlp.arrays import FloatArray

# Polynomials are looked at in so many places between two points; what they can exceed their
# values there by is added.
_PLACES = 16


@dataclass(frozen=True, eq=False)
class Quintic:
    """Polynomials between the points of a trajectory.

    Attributes
    ----------
    spans
        Seconds from point to point, shape (N - 1,).
    values
        Coefficients from the constant one on, shape (6, N - 1, n).
    """

    spans: FloatArray
    values: FloatArray

    @classmethod
    def through(cls, times: FloatArray, states: FloatArray) -> Quintic:
        """Return those through positions, velocities and accelerations, shape (3, N, n)."""
        spans = np.diff(times)
        h = spans[:, None]
        q, v, a = states
        # The end of each polynomial, less what its first three coefficients make of it.
        off = q[1:] - q[:-1] - v[:-1] * h - a[:-1] * h**2 / 2
        off_speed = (v[1:] - v[:-1] - a[:-1] * h) * h
        off_rate = (a[1:] - a[:-1]) * h**2
        cubic = (10 * off - 4 * off_speed + off_rate / 2) / h**3
        quartic = (-15 * off + 7 * off_speed - off_rate) / h**4
        fifth = (6 * off - 3 * off_speed + off_rate / 2) / h**5
        return cls(spans, np.stack([q[:-1], v[:-1], a[:-1] / 2, cubic, quartic, fifth]))

    def largest(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what |velocity|, |acceleration| and |jerk| do not exceed, shape (n,) each."""
        velocity = self._at_places(1)
        acceleration = self._at_places(2)
        jerk = np.max(np.abs(self._at_places(3)), axis=0)
        snap = np.max(np.abs(self._at_places(4)), axis=0)  # linear: its ends are the largest
        # Between two places a function leaves its chord by an eighth of their distance squared
        # times its second derivative. The jerk's own is constant.
        part = (self.spans[:, None] / _PLACES) ** 2 / 8
        crackle = 120 * np.abs(self.values[5])
        jerk = jerk + part * crackle
        speeds = np.max(np.abs(velocity), axis=0) + part * jerk
        rates = np.max(np.abs(acceleration), axis=0) + part * snap
        return np.max(speeds, axis=0), np.max(rates, axis=0), np.max(jerk, axis=0)

    def positions(self) -> FloatArray:
        """Return positions at all places, in order of time, shape (N', n)."""
        places = self._at_places(0)
        return np.concatenate(
            [places[:-1].swapaxes(0, 1).reshape(-1, places.shape[2]), places[-1, -1:]]
        )

    def _at_places(self, order: int) -> FloatArray:
        """Return a derivative at places between each two points, (places, N - 1, n)."""
        shares = np.linspace(0.0, 1.0, _PLACES + 1)[:, None, None]
        times = shares * self.spans[:, None]
        total = np.zeros((len(shares), *self.values.shape[1:]))
        for power in range(5, order - 1, -1):
            factor = float(np.prod(np.arange(power - order + 1, power + 1)))
            total = total * times + factor * self.values[power]
        return total
