"""``lockedjoint measure``: how failure tolerant the Jacobian in a file is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json, Locked, Tolerance


def measure(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV, NPY or JSON; one column per joint.")
    ],
    locked: Locked = 1,
    tolerance: Tolerance = 1e-6,
    as_json: Json = False,
) -> None:
    """Measure the failure tolerance of a Jacobian.

    Reads a matrix from CSV, NPY or JSON (a list of rows, an object with the key "jacobian",
    or a list of such objects as in jacobians.json) and prints its singular values, its worst
    case after locked joints with the joints and direction that realise it, the bound, its
    isotropy, and whether it is optimally failure tolerant. Joints are counted from 0.
    """
    from formulations.assessment import assess
    from formulations.jacobian_file import read_jacobians

    found = [
        {"name": name, **assess(matrix, locked, tolerance).to_dict()}
        for name, matrix in read_jacobians(file)
    ]
    if as_json:
        typer.echo(json.dumps(found if len(found) > 1 else found[0], indent=1))
        return
    typer.echo("\n\n".join(as_text(one) for one in found))


def as_text(measured: dict[str, object]) -> str:
    """Return measures as lines of names and values."""
    width = max(len(name) for name in measured)
    lines = [
        f"{name.replace('_', ' '):<{width}}  {_value(value)}"
        for name, value in measured.items()
    ]
    return "\n".join(lines)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, list):
        return "  ".join(_value(entry) for entry in value)
    return str(value)
