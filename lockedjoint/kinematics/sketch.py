"""A small drawing of an arm, as SVG: its joints and links, seen from the side of its plane."""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import FloatArray

# Width and height of the drawing, and the margin about the arm, in pixels.
_WIDTH = 180
_HEIGHT = 180
_MARGIN = 14
# Radius of a joint's dot and width of a link, in pixels.
_DOT = 4
_LINE = 2
_LINK_COLOUR = "#7A8087"
_JOINT_COLOUR = "#0072B2"
_TIP_COLOUR = "#D55E00"
# An arm that is smaller is drawn as a point, in metres.
_SMALLEST = 1e-9


def sketch(chain: Chain, configuration: FloatArray) -> str:
    """Return a drawing of a chain at a configuration, shape (n,): dots are joints."""
    _, origins, tip, _ = chain.frames(configuration[:, None])
    places = np.vstack([np.zeros(3), origins[..., 0], tip[:, 0]])
    flat = _seen_from_the_side(places)
    size = max(float(np.max(np.ptp(flat, axis=0))), _SMALLEST)
    scale = (min(_WIDTH, _HEIGHT) - 2 * _MARGIN) / size
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
    pixels = (flat - middle) * scale * [1, -1] + [_WIDTH / 2, _HEIGHT / 2]
    points = [f"{x:.1f},{y:.1f}" for x, y in pixels]
    line = (
        f'<polyline points="{" ".join(points)}" fill="none" stroke="{_LINK_COLOUR}"'
        f' stroke-width="{_LINE}"/>'
    )
    dots = [_dot(point, _JOINT_COLOUR) for point in points[1:-1]]
    drawn = "".join([line, *dots, _dot(points[-1], _TIP_COLOUR)])
    label = f"{len(chain.joints)} joints from the base to the tip"
    extent = f'width="{_WIDTH}" height="{_HEIGHT}"'
    return f'<svg {extent} role="img" aria-label="{label}">{drawn}</svg>'


def _seen_from_the_side(places: FloatArray) -> FloatArray:
    """Return places (k, 3) in the vertical plane in which they are widest, (k, 2)."""
    across = places[:, :2] - places[:, :2].mean(axis=0)
    along = np.linalg.svd(across, full_matrices=False)[2][0]
    return np.column_stack([places[:, :2] @ along, places[:, 2]])


def _dot(point: str, colour: str) -> str:
    x, y = point.split(",")
    return f'<circle cx="{x}" cy="{y}" r="{_DOT}" fill="{colour}"/>'
