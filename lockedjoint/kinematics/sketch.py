"""A small drawing of an arm, as SVG: its joints and links, seen from the side of its plane."""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import FloatArray

# The drawing is this wide.
_WIDTH_PIXELS = 180
# The drawing is this high.
_HEIGHT_PIXELS = 180
# The margin about the arm is this wide.
_MARGIN_PIXELS = 14
# A joint's dot has this radius.
_DOT_RADIUS_PIXELS = 4
# A link is this wide.
_LINE_WIDTH_PIXELS = 2
# Links are grey.
_LINK_COLOUR = "#7A8087"
# Joints are blue.
_JOINT_COLOUR = "#0072B2"
# The tip is orange.
_TIP_COLOUR = "#D55E00"
# An arm that is smaller is drawn as a point.
_SMALLEST_M = 1e-9


def sketch(chain: Chain, configuration: FloatArray) -> str:
    """Return a drawing of a chain at a configuration, shape (n,), radians or metres, as SVG.

    Dots are joints. The base is the beginning of the line.
    """
    _, origins, tip, _ = chain.frames(configuration[:, None])
    places = np.vstack([np.zeros(3), origins[..., 0], tip[:, 0]])
    flat = _seen_from_the_side(places)
    size = max(float(np.max(np.ptp(flat, axis=0))), _SMALLEST_M)
    scale = (min(_WIDTH_PIXELS, _HEIGHT_PIXELS) - 2 * _MARGIN_PIXELS) / size
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
    pixels = (flat - middle) * scale * [1, -1] + [_WIDTH_PIXELS / 2, _HEIGHT_PIXELS / 2]
    points = [f"{x:.1f},{y:.1f}" for x, y in pixels]
    line = (
        f'<polyline points="{" ".join(points)}" fill="none" stroke="{_LINK_COLOUR}"'
        f' stroke-width="{_LINE_WIDTH_PIXELS}"/>'
    )
    dots = [_dot(point, _JOINT_COLOUR) for point in points[1:-1]]
    drawn = "".join([line, *dots, _dot(points[-1], _TIP_COLOUR)])
    label = f"{len(chain.joints)} joints from the base to the tip"
    extent = f'width="{_WIDTH_PIXELS}" height="{_HEIGHT_PIXELS}"'
    return f'<svg {extent} role="img" aria-label="{label}">{drawn}</svg>'


def _seen_from_the_side(places: FloatArray) -> FloatArray:
    """Return places (k, 3) in metres in the vertical plane in which they are widest, (k, 2).

    The first coordinate is along the horizontal line of largest variance, the second is z.
    """
    across = places[:, :2] - places[:, :2].mean(axis=0)
    along = np.linalg.svd(across, full_matrices=False)[2][0]
    return np.column_stack([places[:, :2] @ along, places[:, 2]])


def _dot(point: str, colour: str) -> str:
    """Return a circle about a point, written as ``x,y`` in pixels."""
    x, y = point.split(",")
    return f'<circle cx="{x}" cy="{y}" r="{_DOT_RADIUS_PIXELS}" fill="{colour}"/>'
