"""``lockedjoint measure``: how failure tolerant the Jacobian in a file is."""

from formulations.commands.arguments import FailureOptions, JacobianFile, Json, option
from formulations.commands.output import as_text, sharpest_bound, show


def measure(
    file: JacobianFile,
    failures: FailureOptions,
    tolerance: float = option(
        "TOL",
        "Relative tolerance of the verdict 'optimally failure tolerant'.",
        1e-6,
        positive=True,
    ),
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
    from formulations.measures.assessment import measure as measured
    from formulations.measures.read_jacobians import read_jacobians

    rows = []
    for name, matrix in read_jacobians(file):
        values = {"name": name, **measured(matrix, failures.locked, tolerance).to_dict()}
        if failures.locked > 1:
            values |= sharpest_bound(matrix, failures.locked)
        model = failures.model(matrix.shape[1])
        if model is not None:
            known = failures.probabilities_known
            values |= assess_failures(matrix, model, probabilities_known=known)
        rows.append(values)
    text = "\n\n".join(map(as_text, rows))
    show(rows if len(rows) > 1 else rows[0], as_json, lambda _: text)
