"""From where a manipulator is drawn: views in which its joints lie well apart.

Some views are tried, and the one is taken whose least *openness* is the largest: the distance
of joints as they are seen, see `_openness`. Points have the shape (…, 3), in metres, in the
frame of the base.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.manipulator import Manipulator

# Elevations that are tried, in degrees; of equally good ones the first is taken. Larger ones
# look from farther above.
_ELEVATIONS_DEG = (20.0, 30.0, 10.0)
# The step between azimuths that are tried, in degrees. A smaller one may find clearer views,
# and takes longer.
_AZIMUTH_STEP_DEG = 10.0
# The distance of two joints, as a share of the largest one, up to which they are in one place.
# No view can show these apart.
_ONE_PLACE = 1e-6
# The weight of the length at which an axis of length 1 is seen, beside distances of joints in
# metres. A larger one lets fewer views count in which an axis points to the eye.
_AXIS_WEIGHT = 0.5


@dataclass(frozen=True)
class View:
    """The direction towards the eye; the projection is parallel."""

    azimuth: float  #: Degrees, from x towards y.
    elevation: float  #: Degrees above the plane of x and y.

    @property
    def name(self) -> str:
        """From where one looks, in words."""
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


# The view of the plane as it is printed: x to the right, y upwards.
_PLAN = View(-90.0, 90.0)


def clear_views(manipulator: Manipulator) -> tuple[View, ...]:
    """Return two views, a quarter turn apart, in which joints lie well apart.

    The arms of planar tasks have one view, of their plane.
    """
    if manipulator.task.in_plane:
        return (_PLAN,)
    azimuths = np.arange(-180.0, 180.0, _AZIMUTH_STEP_DEG)
    pairs = [
        (View(azimuth, elevation), View(azimuth + 90.0, elevation))
        for elevation, azimuth in product(_ELEVATIONS_DEG, azimuths)
    ]
    return max(pairs, key=lambda pair: min(_openness(manipulator, view) for view in pair))


def _openness(manipulator: Manipulator, view: View) -> float:
    """Return how far apart things are seen: the least of distances and weighted axes.

    The distances, metres, are those between joints, and the end effector, that are in two
    places. Each axis has the length 1, and counts with `_AXIS_WEIGHT` times the length seen.
    """
    places = np.vstack([manipulator.points, manipulator.end_effector])
    flat = view.project(places)[:, :2]
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)
    seen = np.linalg.norm(flat[:, None] - flat[None], axis=-1)
    pairs = apart > _ONE_PLACE * np.max(apart)
    axes = np.linalg.norm(view.project(manipulator.directions)[:, :2], axis=1)
    return min(float(np.min(seen[pairs], initial=np.inf)), _AXIS_WEIGHT * float(np.min(axes)))
