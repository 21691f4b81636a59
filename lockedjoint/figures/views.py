"""From where a manipulator is drawn: views in which its joints lie well apart."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.manipulator import Manipulator


@dataclass(frozen=True)
class View:
    """Direction towards the eye, degrees: azimuth from x to y, elevation above their plane."""

    azimuth: float
    elevation: float

    @property
    def name(self) -> str:
        """From where it is, in words."""
        other = f"azimuth {self.azimuth:g}°, elevation {self.elevation:g}°"
        return "from above (against z)" if self.elevation == 90 else other

    @property
    def frame(self) -> FloatArray:
        """Rows: to the right, upwards, towards the eye; shape (3, 3)."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = [-np.sin(a), np.cos(a), 0.0]
        up = [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]
        eye = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
        return np.array([right, up, eye])

    def project(self, points: FloatArray) -> FloatArray:
        """Return right, up and depth (larger is nearer) of points, shape (…, 3)."""
        return np.asarray(points @ self.frame.T)


#: The plane as it is printed: x to the right, y upwards.
_PLAN = View(-90.0, 90.0)


def clear_views(manipulator: Manipulator) -> tuple[View, ...]:
    """Return two views, a quarter turn apart, in which joints lie well apart.

    The arms of planar tasks have one view, of their plane.
    """
    if manipulator.task.in_plane:
        return (_PLAN,)
    pairs = [
        (View(azimuth, elevation), View(azimuth + 90.0, elevation))
        for elevation, azimuth in product((20.0, 30.0, 10.0), np.arange(-180.0, 180.0, 10.0))
    ]
    return max(pairs, key=lambda pair: min(_openness(manipulator, view) for view in pair))


def _openness(manipulator: Manipulator, view: View) -> float:
    """Smallest distance seen between joints in two places, or half the shortest axis seen."""
    places = np.vstack([manipulator.points, manipulator.end_effector])
    flat = view.project(places)[:, :2]
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    seen = np.linalg.norm(flat[:, None] - flat[None], axis=-1)
    pairs = apart > 1e-6 * np.max(apart)
    axes = np.linalg.norm(view.project(manipulator.directions)[:, :2], axis=1)
    return min(float(np.min(seen[pairs], initial=np.inf)), 0.5 * float(np.min(axes)))
