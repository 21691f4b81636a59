"""The forms a manipulator can be written in: axes, Denavit–Hartenberg, URDF, figure."""

from collections.abc import Mapping
from typing import Any

from tabulate import tabulate

from formulations import measures
from formulations.commands.output import as_table, shown
from formulations.plot.manipulator import figure
from formulations.plot.style import content
from formulations.synthesis.choice import Choice
from formulations.synthesis.dh import Convention, denavit_hartenberg
from formulations.synthesis.links import link_gap
from formulations.synthesis.manipulator import Manipulator
from formulations.synthesis.write_urdf import urdf
from nlp.arrays import FloatArray, finite_or_none

_DIGITS = 9


def write_down(manipulator: Manipulator, form: str, convention: str, figure_kind: str) -> bytes:
    """Return a manipulator as ``axes``, ``dh``, ``urdf`` or ``figure``: a file's content.

    A ``dh`` table has a `convention`, ``standard`` or ``modified``; a ``figure`` a kind,
    ``svg``, ``png`` or ``pdf``. InputError if there is no such kind, or matplotlib is missing.
    """
    if form == "axes":
        return _axes_text(manipulator).encode()
    if form == "dh":
        return _dh_text(manipulator, Convention(convention)).encode()
    if form == "urdf":
        return urdf(manipulator).encode()
    return content(figure(manipulator), figure_kind)


def as_plain(manipulator: Manipulator, convention: str) -> dict[str, object]:
    """Return everything but the figure as plain values: axes, table and URDF."""
    table = denavit_hartenberg(manipulator, Convention(convention))
    return {**manipulator.to_dict(), "dh": table.to_dict(), "urdf": urdf(manipulator)}


def summary(choice: Choice, deviation: float, jacobian: FloatArray) -> dict[str, object]:
    """Return how a manipulator was chosen, its failure tolerance, and which links touch.

    The worst case is given of the robot, in metres, and of the Jacobian that it realises, in
    that one's unit of length.
    """
    worst = measures.worst_case_sigma(choice.manipulator.jacobian())
    found = link_gap(choice.manipulator)
    return {
        **choice.to_dict(),
        "worst_case_sigma": worst,
        "worst_case_sigma_given": measures.worst_case_sigma(jacobian),
        "speeds": choice.manipulator.speeds.tolist(),
        "deviation": deviation,
        "gap": finite_or_none(found.gap),
        "touching": [list(pair) for pair in found.touching],
    }


def touching_note(found: Mapping[str, Any]) -> str | None:
    """Return a sentence that names the links of a summary that touch; None if none do."""
    if not found["touching"]:
        return None
    pairs = [f"{i} and {j}" for i, j in found["touching"]]
    named = ", ".join(pairs[:8]) + (f", … ({len(pairs)} pairs)" if len(pairs) > 8 else "")
    return f"links {named} touch (counted from 0): bodies overlap by {-found['gap']:.3g} m"


def _axes_text(manipulator: Manipulator) -> str:
    """Return the axes as a table: direction, and the point where the joint sits."""
    axes = manipulator.to_dict()
    joints, tip = as_table(axes["joints"], _DIGITS), shown(axes["end_effector"])
    return f"{joints}\n\nend effector  {tip}\n"


def _dh_text(manipulator: Manipulator, convention: Convention) -> str:
    """Return the Denavit–Hartenberg table, and the base and tool transforms."""
    table = denavit_hartenberg(manipulator, convention)
    names = {"a": "a before", "alpha": "alpha before"}
    before = names if convention is Convention.MODIFIED else {}
    rows = [
        {**{before.get(k, k): v for k, v in row.items()}, "speed": speed}
        for row, speed in zip(table.rows(), manipulator.speeds.tolist(), strict=True)
    ]
    base, tool = (
        tabulate(pose.tolist(), tablefmt="plain", floatfmt=f".{_DIGITS}g")
        for pose in (table.base, table.tool)
    )
    parts = (as_table(rows, _DIGITS), f"base\n{base}", f"tool\n{tool}")
    return "\n\n".join([f"{convention} convention", *parts]) + "\n"
