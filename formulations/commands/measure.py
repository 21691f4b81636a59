"""``lockedjoint measure``: how failure tolerant the Jacobian in a file is."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import (
    Json,
    Locked,
    NeverFails,
    Probabilities,
    Tolerance,
    failure_model,
)
from formulations.commands.output import as_text, sharpest_bound, show


def measure(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="CSV, NPY, NPZ or JSON; one column per joint."),
    ],
    locked: Locked = 1,
    failure_probabilities: Probabilities = None,
    never_fails: NeverFails = None,
    tolerance: Tolerance = 1e-6,
    as_json: Json = False,
) -> None:
    """Measure the failure tolerance of a Jacobian.

    Reads a matrix from CSV, NPY, NPZ or JSON (a list of rows, an object with the key
    "jacobian", or a list of such objects as in jacobians.json) and prints its singular values,
    its worst case after locked joints with the joints and direction that realise it, the
    bound, its isotropy, and whether it is optimally failure tolerant. Joints are counted from
    0. Of several locked joints the bound is the mean over failures; the sharpest one known of
    all Jacobians of this shape and norm is shown too. With failure probabilities or joints that
    never fail also the expected dexterity and the probability-weighted worst case.
    """
    from formulations.bounds.unequal_failures import assess_failures
    from formulations.io.jacobians import read_jacobians
    from formulations.measures.assessment import measure as measured

    found = []
    for name, matrix in read_jacobians(file):
        values = {"name": name, **measured(matrix, locked, tolerance).to_dict()}
        if locked > 1:
            values |= sharpest_bound(matrix, locked)
        joints = matrix.shape[1]
        model = failure_model(failure_probabilities, never_fails, joints, locked)
        if model is not None:
            known = failure_probabilities is not None
            values |= assess_failures(matrix, model, probabilities_known=known)
        found.append(values)
    text = "\n\n".join(as_text(one) for one in found)
    show(found if len(found) > 1 else found[0], as_json, lambda _: text)
