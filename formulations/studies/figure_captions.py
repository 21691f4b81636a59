"""What stands above and below each figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Caption:
    """Heading, description for those who do not see it, and text; {starts} is filled in."""

    title: str
    seen: str
    text: str


CAPTIONS: Mapping[str, Caption] = MappingProxyType(
    {
        "figure-1": Caption(
            "Planar 3R, the paper's Fig. 1",
            "Four planar 3R manipulators with the optimal Jacobian",
            "The optimal Jacobian (12), solved for by max-min, is that of four\n"
            "different manipulators: its columns may come in any order and with any\n"
            "sign, and of the 48 arrangements twelve at a time are the same up to a\n"
            "rotation. All joints lie on one circle about the end effector.",
        ),
        "figure-3": Caption(
            "Planar 4R, the paper's Fig. 3",
            "Eight members of the family of optimal planar 4R manipulators",
            "Members of the family (16), upside down so that the base is below. Those\n"
            "above were solved for with two locked joints and lie at odd multiples of\n"
            "45°, as the paper says; those below, with one locked joint, lie anywhere:\n"
            "the nearest to 20°, 110°, 200° and 290° of {starts} starts are drawn.",
        ),
        "seven-axes": Caption(
            "The 7R optimum",
            "Seven axes tangent to a sphere, from two sides",
            "The max-min optimum of unit revolute 7R. Every axis touches the unit\n"
            "sphere about the end effector; what is behind it is pale.",
        ),
        "singular-values": Caption(
            "Singular values",
            "Singular values before and after each failure",
            "The certified bound is on the worst case of any unit revolute 7R, with all\n"
            "rounding bounded ([bounds](../bounds/README.md)); single failures may\n"
            "leave more.",
        ),
        "trade-off": Caption(
            "Isotropy against worst case",
            "Two curves: the best worst case against the distance from isotropy",
            "Max-min with a limit on the isotropy defect ½‖JJᵀ − (T/m)I‖², swept from\n"
            "the statement of exact isotropy (where there is none: from the residual\n"
            "minimum) to max-min without a limit. Each point is the best of {starts}\n"
            "random starts and of the optima of both neighbours, judged from J alone.",
        ),
        "optima": Caption(
            "Optima over starts",
            "Histograms of the worst case that random starts end at",
            "All seven-joint, {starts} starts each; a number on a bar is the number of\n"
            "starts in it. Starts fail where the solver does not say solved or the\n"
            "Jacobian fails the check. `--store study.db` shows the starts of a\n"
            "campaign instead.",
        ),
    }
)
