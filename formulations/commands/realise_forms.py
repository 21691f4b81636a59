"""The forms a manipulator can be written in: axes, Denavit–Hartenberg, URDF, figure."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from tabulate import tabulate

from formulations import measures
from formulations.plot.manipulator import figure
from formulations.plot.style import content
from formulations.synthesis.choice import Choice
from formulations.synthesis.dh import Convention, DenavitHartenberg, denavit_hartenberg
from formulations.synthesis.links import link_gap
from formulations.synthesis.manipulator import Manipulator
from formulations.synthesis.write_urdf import urdf
from nlp.arrays import FloatArray, finite_or_none

_DIGITS = ".9g"


def write_down(manipulator: Manipulator, form: str, convention: str, figure_kind: str) -> bytes:
    """Return a manipulator as ``axes``, ``dh``, ``urdf`` or ``figure``: a file's content.

    A ``dh`` table has a `convention`, ``standard`` or ``modified``; a ``figure`` a kind,
    ``svg``, ``png`` or ``pdf``. InputError if there is no such kind, or matplotlib is missing.
    """
    if form == "axes":
        return f"{_axes_text(manipulator)}{_speeds_text(manipulator)}\n".encode()
    if form == "dh":
        table = _dh_text(denavit_hartenberg(manipulator, Convention(convention)))
        return f"{table}{_speeds_text(manipulator)}\n".encode()
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
    shown = ", ".join(pairs[:8]) + (f", … ({len(pairs)} pairs)" if len(pairs) > 8 else "")
    return f"links {shown} touch (counted from 0): bodies overlap by {-found['gap']:.3g} m"


def summary_lines(found: Mapping[str, Any]) -> dict[str, object]:
    """Return a summary as lines for people: signs for flips, a line for each criterion."""
    speeds = found["speeds"]
    return {
        "order": found["order"],
        "signs": "".join("-" if flip else "+" for flip in found["flips"]),
        "chosen by": found["criterion"],
        "looked at": found["method"],
        "orders and signs": found["arrangements"],
        "distinct manipulators": found["distinct"],
        "deviation from the Jacobian": found["deviation"],
        "worst case sigma (metres)": found["worst_case_sigma"],
        "worst case sigma of the file": found["worst_case_sigma_given"],
        "gap between links": found["gap"],
        "slid along their axes": found.get("slid", False),
        "links that touch": ", ".join(f"{i}-{j}" for i, j in found["touching"]) or "none",
        **found["criteria"],
        **({"metres per unit of joints": speeds} if set(speeds) != {1.0} else {}),
    }


def _axes_text(manipulator: Manipulator) -> str:
    """Return the axes as a table: direction, and the point where the joint sits."""
    kinds = [kind[0].upper() for kind in manipulator.kinds]
    axes = np.hstack([manipulator.directions, manipulator.points]).tolist()
    joints = enumerate(zip(manipulator.columns, kinds, axes, strict=True))
    rows = [[i, column, kind, *axis] for i, (column, kind, axis) in joints]
    names = ["joint", "column", "kind", *(f"axis {c}" for c in "xyz"), *"xyz"]
    tip = "  ".join(f"{value:{_DIGITS}}" for value in manipulator.end_effector)
    return f"{_table(rows, names)}\n\nend effector  {tip}"


def _speeds_text(manipulator: Manipulator) -> str:
    """Return a line if prismatic joints have other speeds than 1."""
    speeds = manipulator.speeds
    shown = "  ".join(f"{speed:{_DIGITS}}" for speed in speeds)
    return f"\n\nmetres per unit of joints  {shown}" if np.any(speeds != 1) else ""


def _dh_text(table: DenavitHartenberg) -> str:
    """Return the Denavit–Hartenberg table, and the base and tool transforms."""
    rows = [[*(row | {"kind": str(row["kind"])[0].upper()}).values()] for row in table.rows()]
    names = ["joint", "kind", "theta", "d", "a", "alpha"]
    if table.convention is Convention.MODIFIED:
        names[4:] = ["a before", "alpha before"]
    base, tool = (
        tabulate(pose.tolist(), tablefmt="plain", floatfmt=_DIGITS)
        for pose in (table.base, table.tool)
    )
    convention = f"{table.convention} convention"
    return "\n\n".join([convention, _table(rows, names), f"base\n{base}", f"tool\n{tool}"])


def _table(rows: Sequence[Sequence[object]], names: Sequence[str]) -> str:
    return str(tabulate(rows, names, tablefmt="simple", floatfmt=_DIGITS))
