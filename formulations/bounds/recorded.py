"""Files of many bounds, such as `planar.json` and `two_point.json`: each row is proved anew.

One of branch and bound is searched again at the level that it claims; a two-point bound is
proved from its multipliers. Neither is believed for what it says of itself.
"""

from __future__ import annotations

from typing import Any, TypeVar, get_args

from formulations.bounds.planar import Measure, PlanarBound, planar_bound
from formulations.bounds.two_point_proof import TwoPointBound
from formulations.existence.certificate import shown
from formulations.existence.reading import Part

Recorded = TypeVar("Recorded", PlanarBound, TwoPointBound)

# Limits on what a file may ask for; those on record stay far below them.
_ROWS, _NODES, _LARGEST = range(1, 1001), range(1, 100_001), 1e6
_BLOCKS, _TERMS = range(1, 9), range(1, 17)


def read_bounds(value: Any) -> list[PlanarBound | TwoPointBound]:
    """Return the bounds of such a file; CertificateError if it is not exactly one."""
    rows = Part(value).items(_ROWS)
    planar = isinstance(rows[0].value, dict) and "measure" in rows[0].value
    return [_planar(row) if planar else _two_point(row) for row in rows]


def is_proved_again(bound: PlanarBound | TwoPointBound) -> bool:
    """Whether a bound is proved; a search may look at twice the nodes that are claimed."""
    if isinstance(bound, TwoPointBound):
        return bound.is_proved()
    numbers = (bound.joints, bound.locked, bound.level, bound.measure)
    return planar_bound(*numbers, most_nodes=2 * bound.nodes).proved


def _planar(part: Part) -> PlanarBound:
    names = ("measure", "joints", "locked", "level", "proved", "nodes", "kind", "command")
    measure, joints, locked, level, _, nodes, *_ = part.fields(*names)
    if measure.value not in get_args(Measure):
        measure.refuse(f"{shown(measure.value)} is not known")
    n, most = joints.whole(range(3, 21)), nodes.whole(_NODES)
    k, least = locked.whole(range(1, n - 1)), level.number(_LARGEST)
    if least <= 0:
        level.refuse(f"{least} is not above 0")
    found = PlanarBound(measure.value, n, k, least, True, most)
    return _as_written(part, found)


def _two_point(part: Part) -> TwoPointBound:
    names = ("task_dimension", "joints", "trace_limit", "violation", "blocks", "lift")
    dimension, joints, limit, violation, blocks, lift, *_ = part.fields(
        *names, "singular_value_bound", "kind", "command"
    )
    m = dimension.whole(range(2, 13))
    n, trace = joints.whole(range(m + 2, 61)), limit.number(_LARGEST)
    if trace <= 0:
        limit.refuse(f"{trace} is not above 0")
    matrices = [[_numbers(row) for row in one.items(_BLOCKS)] for one in blocks.items(_BLOCKS)]
    if len({len(one) for one in matrices} | {len(row) for one in matrices for row in one}) != 1:
        blocks.refuse("not square matrices of one size")
    numbers = (violation.number(_LARGEST), matrices, _numbers(lift))
    return _as_written(part, TwoPointBound(m, n, trace, *numbers))


def _numbers(part: Part) -> list[float]:
    return [one.number(_LARGEST) for one in part.items(_TERMS)]


def _as_written(part: Part, bound: Recorded) -> Recorded:
    """Return the bound if what it says of itself is what the row says."""
    for name, value in bound.to_dict().items():
        if part.value[name] != value:
            part.refuse(f"{name}: {shown(part.value[name])} is not {shown(value)}")
    return bound
