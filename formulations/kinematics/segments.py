"""The distance of two line segments, for many at once."""

import numpy as np

from nlp.arrays import FloatArray


def segment_distance(
    start: FloatArray,
    end: FloatArray,
    other_start: FloatArray,
    other_end: FloatArray,
    axis: int = -1,
) -> FloatArray:
    """Distance between two segments: of interiors, or of an end and a segment.

    Coordinates are along one axis of the arrays, the last one by default.
    """
    u, v, gap = end - start, other_end - other_start, other_start - start
    cross = np.cross(u, v, axis=axis)
    square = np.sum(cross**2, axis=axis)
    size = np.sum(u**2, axis=axis) * np.sum(v**2, axis=axis)
    skew = square > 1e-20 * size
    safe = np.where(skew, square, 1.0)
    s = np.sum(np.cross(gap, v, axis=axis) * cross, axis=axis) / safe
    t = np.sum(np.cross(gap, u, axis=axis) * cross, axis=axis) / safe
    inside = skew & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    between = np.abs(np.sum(gap * cross, axis=axis)) / np.sqrt(safe)

    def to(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        span = end - start
        square = np.sum(span**2, axis=axis, keepdims=True)
        part = np.sum((point - start) * span, axis=axis, keepdims=True)
        part = np.clip(part / np.where(square > 0, square, 1), 0, 1)
        return np.asarray(np.linalg.norm(point - start - part * span, axis=axis))

    first, second = (start, end), (other_start, other_end)
    ends = np.minimum.reduce(
        [*(to(point, *second) for point in first), *(to(point, *first) for point in second)]
    )
    return np.asarray(np.where(inside, between, ends))
