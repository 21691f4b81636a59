"""Search for the exact values of the atlas: Newton's method to many digits, then PARI/GP.

Optima of free columns are recognised as a whole: S, x_f, w_f, v_F and c_F of `exact_optimum`,
in one number field. Of other models only the polynomial of t is found.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import mpmath as mp
import numpy as np
from cypari import pari

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.collection import proved_maximum, read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.atlas.local_optimality import worst_failures
from lockedjoint.formulations.existence.certificate import CertificateError
from results.atlas import many_digits
from results.atlas.exact_optimum import records, write_records
from results.atlas.exact_proof import prove_exact_value
from results.atlas.many_digits import NumberTable, nearest_solution, numbers, small

# Number of significant digits of `near`.
_SHOWN_DIGITS = 20
# Number of decimal digits that the rational number near θ has, and its distance from θ.
_ROOT_DIGITS = 15
_ROOT_RADIUS = "1/100000000000000"
# Columns span a direction more if the least singular value with one more column is above this.
_LEAST_SINGULAR_VALUE = 0.1


def find(names: Sequence[str], digits: Sequence[int]) -> None:
    """Find the exact values of some entries, or of all, and write both files.

    Polynomials are sought with the first number of digits, and of free columns with the next
    one if that is not enough.
    """
    found = dict(records())
    for page in read_atlas():
        name = page.entry.name
        isolated = page.family == 0 and page.entry.formulation == max_min.NAME
        if not isolated or (names and name not in names):
            continue
        found.pop(name, None)
        for number in digits if page.entry.model.startswith("free") else digits[:1]:
            mp.mp.dps = number
            pari.set_real_precision(number)
            try:
                record = found[name] = found_record(page)
                result = f"degree {len(record['polynomial']) - 1}, {record['proof']}"
            except ArithmeticError as error:
                result = str(error)
            print(name, f"{number} digits:", result, flush=True)
            if name in found and found[name]["proof"] != "numerical":
                break
        write_records(found)


def found_record(page: EntryPage) -> dict[str, Any]:
    """Return the record of an entry, with the most that is proved; or raise ArithmeticError."""
    maximum = proved_maximum(page.entry, page.jacobian)
    jacobian, t = many_digits.solution(page, maximum)
    polynomial = many_digits.algebraic(t)
    near = mp.nstr(t, _SHOWN_DIGITS)
    record = {"polynomial": polynomial, "near": near, "proof": "numerical"}
    if not page.entry.model.startswith("free"):
        return record
    try:
        optimum = recognised(page, jacobian, t, polynomial, maximum)
    except ArithmeticError as error:
        print("  ", page.entry.name, error)
        return record
    for proof in ("maximum", "sharp maximum", "attained"):
        stated = {**record, **optimum, "proof": proof}
        try:
            prove_exact_value(page.entry, page.jacobian, maximum, stated)
        except CertificateError as error:
            print("  ", page.entry.name, error)
        else:
            return stated
    return record


def recognised(
    page: EntryPage, jacobian: Any, t: Any, polynomial: list[int], maximum: LocalMaximum | None
) -> dict[str, Any]:
    """Return the exact optimum next to a Jacobian of many digits, as it is on file.

    ArithmeticError where its numbers are not recognised.
    """
    gram, coordinates, squared_scales = invariants(jacobian)
    gram_inverse = _inverted(gram)
    failures = worst_failures(page.jacobian, page.entry.failures)
    kept = np.array([one.kept for one in failures])
    products = squared_scales * coordinates[:, None] * coordinates
    vectors = np.array(
        [_null_vector(products @ row - t * gram_inverse) for row in numbers(kept)]
    )
    active = np.ones(len(kept), dtype=bool)
    if maximum is not None:
        active = (kept[:, None] == maximum.kept).all(axis=2).any(axis=1)
    # The eigenvectors u_F = B⁻ᵀv_F have these squared lengths; the multipliers are those of
    # unit vectors, divided by them.
    squared_lengths = np.sum(vectors @ gram_inverse * vectors, axis=1)
    pairings = vectors @ coordinates * kept
    gradients = vectors[:, :, None] * pairings[:, None] / squared_lengths[:, None, None]
    shared = page.entry.model != "free"
    multipliers = numbers(np.zeros(len(kept)))
    unit = _multipliers(gradients[active], gram @ coordinates, shared)
    multipliers[active] = unit / squared_lengths[active]
    why = ""
    scalars = [t, *gram.ravel(), *coordinates.ravel(), *squared_scales]
    for theta, field in many_digits.fields(t, polynomial, scalars):
        table = NumberTable(theta, len(field) - 1)
        try:
            table.place(t)
            matrices = {
                "gram": table.places(gram),
                "gram_inverse": table.places(gram_inverse),
                "coordinates": table.places(coordinates),
                "squared_scales": table.places(squared_scales),
                "worst_sets": [np.flatnonzero(row == 0).tolist() for row in kept],
                "eigenvectors": table.places(vectors),
                "multipliers": table.places(multipliers),
            }
        except ArithmeticError as error:
            why = str(error)
            continue
        near = Fraction(int(mp.nint(theta * 10**_ROOT_DIGITS)), 10**_ROOT_DIGITS)
        root = [str(near), _ROOT_RADIUS]
        return {"field": field, "root": root, "numbers": table.numbers, **matrices}
    raise ArithmeticError(f"{why} ({len(kept)} sets)")


def invariants(jacobian: Any) -> tuple[Any, Any, Any]:
    """Return S, the x_f and the w_f, which neither a frame nor signs of columns change.

    The frame B consists of columns of J. Rows and columns of the x_f are scaled such that the
    entries along a spanning tree are 1: the tree ties each row to a column, or to another row
    where a column has one entry only.
    """
    m, n = jacobian.shape
    basis: list[int] = []
    for f in range(n):
        columns = jacobian[:, [*basis, f]].astype(float)
        least = np.linalg.svd(columns, compute_uv=False)[-1]
        if len(basis) < m and least > _LEAST_SINGULAR_VALUE:
            basis.append(f)
    frame = jacobian[:, basis]
    coordinates, gram = _inverted(frame) @ jacobian, frame.T @ frame
    nonzero = np.abs(coordinates) > small(3)
    row_scales: dict[int, Any] = {0: mp.mpf(1)}
    column_scales: dict[int, Any] = {}
    while len(row_scales) < m or len(column_scales) < n:
        edges = [
            (i, f) for i, f in np.argwhere(nonzero) if (i in row_scales) != (f in column_scales)
        ]
        if edges:
            i, f = edges[0]
            if i in row_scales:
                column_scales[f] = 1 / (row_scales[i] * coordinates[i, f])
            else:
                row_scales[i] = 1 / (column_scales[f] * coordinates[i, f])
        else:
            i = next(i for i in range(m) if i not in row_scales)
            tied = [k for k in row_scales if abs(gram[i, k]) > small(3)]
            row_scales[i] = 1
            if tied:
                k = tied[0]
                row_scales[i] = gram[i, k] * row_scales[k] / gram[k, k]
    rows = np.array([row_scales[i] for i in range(m)])
    columns = np.array([column_scales[f] for f in range(n)])
    return (
        gram / (rows[:, None] * rows),
        coordinates * rows[:, None] * columns,
        1 / columns**2,
    )


def _inverted(matrix: Any) -> Any:
    inverse = mp.matrix(matrix.tolist()) ** -1
    return np.array(inverse.tolist(), dtype=object).reshape(matrix.shape)


def _null_vector(matrix: Any) -> Any:
    """Return a vector that a symmetric matrix maps to zero, with an entry 1."""
    place = int(np.abs(np.linalg.svd(matrix.astype(float))[2][-1]).argmax())
    unit = numbers(np.eye(len(matrix))[place])
    vector = _inverted(matrix + np.outer(unit, unit)) @ unit
    if max(abs(v) for v in matrix @ vector) > small(2):
        raise ArithmeticError("t is no eigenvalue")
    return vector


def _multipliers(gradients: Any, dual_coordinates: Any, shared: bool) -> Any:
    """Return the multipliers: of sum 1, and of all solutions the nearest to equal ones.

    Σ c_F gradient_F = λ_f S x_f for every f, with one λ if it is `shared`.
    """
    size, n = len(gradients), dual_coordinates.shape[1]
    normals = [dual_coordinates]
    if not shared:
        normals = [np.where(np.arange(n) == f, dual_coordinates, 0) for f in range(n)]
    rows = [one.ravel() for one in [*gradients, *(-normal for normal in normals)]]
    sums = [1] * size + [0] * len(normals)
    matrix = numbers(np.vstack([np.array(rows).T, sums]))
    right = numbers(np.eye(len(matrix))[-1])
    equal = np.array([mp.mpf(1) / size] * size + [mp.mpf(0)] * len(normals))
    return nearest_solution(matrix, right, equal)[:size]
