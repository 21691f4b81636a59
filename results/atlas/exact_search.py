"""Search for the exact values of the atlas: Newton's method to many digits, then PARI/GP.

Optima of free columns are recognised as a whole, in one number field. Of other models only the
polynomial of t is found. The letters are those of `exact_optimum`; f is a joint, F a set of
locked joints after whose loss the worst case is least, and "sets" the number of these F:

- J: the Jacobian, shape (m, n); its columns are j_f = ±√w_f B x_f. t: the squared worst case;
- B: a frame of the task space, shape (m, m). S = BᵀB: its Gram matrix, ``gram``;
- x_f: coordinates of column f in the frame, up to a scale: the columns of ``coordinates``,
  shape (m, n). w_f: the square of this scale, ``squared_scales``, shape (n,);
- v_F: null vector of M_F = Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹: the rows of ``eigenvectors``, shape
  (sets, m). u_F = B⁻ᵀv_F is the eigenvector at t of JJᵀ without the columns F;
- c_F: multiplier of set F, ``multipliers``, shape (sets,). It is 0 if F is not needed;
- θ: generator of the field, a root of its monic polynomial, ``field``.

Arrays of numbers with many digits have the dtype object and hold `mpmath.mpf`: `DigitArray`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import mpmath as mp
import numpy as np
from cypari import pari

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.collection import proved_maximum, read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.atlas.local_optimality import worst_failures
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray
from results.atlas import many_digits
from results.atlas.exact_optimum import records, write_records
from results.atlas.exact_proof import prove_exact_value
from results.atlas.many_digits import NumberTable, nearest_solution, numbers, small

#: Array of dtype object with numbers of many digits, `mpmath.mpf`.
DigitArray: TypeAlias = Any
#: One number of many digits, `mpmath.mpf`.
DigitNumber: TypeAlias = Any

# Number of significant digits of `near`, the decimal value of t that is shown.
_SHOWN_DIGITS = 20
# Number of decimal digits of the rational number near θ.
_ROOT_DIGITS = 15
# Largest distance of this number from θ, as a fraction: more than its rounding.
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
    # The order is from the most that can be proved to the least.
    for proof in ("maximum", "sharp maximum", "attained"):
        stated = {**record, **optimum, "proof": proof}
        try:
            prove_exact_value(page.entry, page.jacobian, maximum, stated)
        except CertificateError as error:
            print("  ", page.entry.name, error)
        else:
            return stated
    return record


@dataclass(frozen=True, eq=False)
class _Optimum:
    """An optimum of free columns in numbers of many digits."""

    t: DigitNumber
    #: S, shape (m, m).
    gram: DigitArray
    #: S⁻¹, shape (m, m).
    gram_inverse: DigitArray
    #: The x_f as columns, shape (m, n).
    coordinates: DigitArray
    #: The w_f, shape (n,).
    squared_scales: DigitArray
    #: The sets F as doubles, shape (sets, n): 0 for a joint that locks, 1 for one that is left.
    remaining: FloatArray
    #: The v_F as rows, shape (sets, m).
    eigenvectors: DigitArray
    #: The c_F, shape (sets,).
    multipliers: DigitArray

    @property
    def scalars(self) -> list[DigitNumber]:
        """Numbers of which one may generate the field, or its sum with t."""
        return [self.t, *self.gram.ravel(), *self.coordinates.ravel(), *self.squared_scales]

    def recorded(self, table: NumberTable) -> dict[str, Any]:
        """Return its record: places of numbers in a table, where new ones are added.

        ArithmeticError if one is not of the field.
        """
        # The record says that t is the first number.
        table.place(self.t)
        return {
            "gram": table.places(self.gram),
            "gram_inverse": table.places(self.gram_inverse),
            "coordinates": table.places(self.coordinates),
            "squared_scales": table.places(self.squared_scales),
            "worst_sets": [np.flatnonzero(row == 0).tolist() for row in self.remaining],
            "eigenvectors": table.places(self.eigenvectors),
            "multipliers": table.places(self.multipliers),
        }


def recognised(
    page: EntryPage,
    jacobian: DigitArray,
    t: DigitNumber,
    polynomial: list[int],
    maximum: LocalMaximum | None,
) -> dict[str, Any]:
    """Return the exact optimum next to a Jacobian of many digits, as it is on file.

    Parameters
    ----------
    page
        The entry with its Jacobian in double precision.
    jacobian
        J, shape (m, n).
    t
        The squared worst case.
    polynomial
        The integer polynomial of t, constant first.
    maximum
        The local maximum that the library proves; None if it proves none.

    Raises
    ------
    ArithmeticError
        If its numbers are not recognised.
    """
    optimum = _optimum(page, jacobian, t, maximum)
    why = ""
    for theta, field in many_digits.fields(t, polynomial, optimum.scalars):
        table = NumberTable(theta, len(field) - 1)
        try:
            recorded = optimum.recorded(table)
        except ArithmeticError as error:
            why = str(error)
            continue
        near = Fraction(int(mp.nint(theta * 10**_ROOT_DIGITS)), 10**_ROOT_DIGITS)
        root = [str(near), _ROOT_RADIUS]
        return {"field": field, "root": root, "numbers": table.numbers, **recorded}
    raise ArithmeticError(f"{why} ({len(optimum.remaining)} sets)")


def _optimum(
    page: EntryPage, jacobian: DigitArray, t: DigitNumber, maximum: LocalMaximum | None
) -> _Optimum:
    """Return what `exact_optimum` says of a Jacobian, to many digits."""
    gram, coordinates, squared_scales = invariants(jacobian)
    gram_inverse = _inverted(gram)
    failures = worst_failures(page.jacobian, page.entry.failures)
    remaining = np.array([one.kept for one in failures])
    # w_f x_f x_fᵀ along the last axis, shape (m, m, n): its product with 0 or 1 for each joint
    # sums those that are left.
    products = squared_scales * coordinates[:, None] * coordinates
    eigenvectors = np.array(
        [_null_vector(products @ left - t * gram_inverse) for left in numbers(remaining)]
    )
    # Sets with a multiplier: those of the proof, if there is one.
    active = np.ones(len(remaining), dtype=bool)
    if maximum is not None:
        active = (remaining[:, None] == maximum.kept).all(axis=2).any(axis=1)
    # |u_F|² = v_FᵀS⁻¹v_F, shape (sets,). Multipliers of unit vectors are divided by it.
    squared_lengths = np.sum(eigenvectors @ gram_inverse * eigenvectors, axis=1)
    # v_F·x_f of the joints that are left, 0 of those that lock, shape (sets, n).
    pairings = eigenvectors @ coordinates * remaining
    # v_F (v_F·x_f)/|u_F|², shape (sets, m, n).
    gradients = eigenvectors[:, :, None] * pairings[:, None] / squared_lengths[:, None, None]
    shared = page.entry.model != "free"
    of_unit_vectors = _multipliers(gradients[active], gram @ coordinates, shared)
    multipliers = numbers(np.zeros(len(remaining)))
    multipliers[active] = of_unit_vectors / squared_lengths[active]
    return _Optimum(
        t=t,
        gram=gram,
        gram_inverse=gram_inverse,
        coordinates=coordinates,
        squared_scales=squared_scales,
        remaining=remaining,
        eigenvectors=eigenvectors,
        multipliers=multipliers,
    )


def invariants(jacobian: DigitArray) -> tuple[DigitArray, DigitArray, DigitArray]:
    """Return S, the x_f and the w_f, which neither a frame nor signs of columns change.

    Their shapes are (m, m), (m, n) and (n,), that of J is (m, n). The frame B consists of
    columns of J. Rows and columns of the x_f are scaled such that the entries along a spanning
    tree are 1: the tree ties each row to a column, or to another row where a column has one
    entry only.
    """
    m, n = jacobian.shape
    basis: list[int] = []
    for f in range(n):
        columns = jacobian[:, [*basis, f]].astype(float)
        least = np.linalg.svd(columns, compute_uv=False)[-1]
        if len(basis) < m and least > _LEAST_SINGULAR_VALUE:
            basis.append(f)
    frame = jacobian[:, basis]
    coordinates = _inverted(frame) @ jacobian
    gram = frame.T @ frame
    row_scales, column_scales = _scales(coordinates, gram)
    return (
        gram / (row_scales[:, None] * row_scales),
        coordinates * row_scales[:, None] * column_scales,
        1 / column_scales**2,
    )


def _scales(coordinates: DigitArray, gram: DigitArray) -> tuple[DigitArray, DigitArray]:
    """Return the scales of rows and columns, shapes (m,) and (n,), along a spanning tree."""
    m, n = coordinates.shape
    nonzero = np.abs(coordinates) > small(3)
    row_scales: dict[int, DigitNumber] = {0: mp.mpf(1)}
    column_scales: dict[int, DigitNumber] = {}
    while len(row_scales) < m or len(column_scales) < n:
        # Entries that tie a row that has a scale to a column that has none, or the reverse.
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
    return rows, columns


def _inverted(matrix: DigitArray) -> DigitArray:
    """Return the inverse of a square matrix, to all digits."""
    inverse = mp.matrix(matrix.tolist()) ** -1
    return np.array(inverse.tolist(), dtype=object).reshape(matrix.shape)


def _null_vector(matrix: DigitArray) -> DigitArray:
    """Return the vector, shape (m,), that a symmetric matrix maps to zero, with an entry 1.

    With e, the unit vector of this entry, it is (matrix + e eᵀ)⁻¹e.
    """
    # The entry is the largest of the vector in double precision.
    place = int(np.abs(np.linalg.svd(matrix.astype(float))[2][-1]).argmax())
    unit = numbers(np.eye(len(matrix))[place])
    vector = _inverted(matrix + np.outer(unit, unit)) @ unit
    if max(abs(v) for v in matrix @ vector) > small(2):
        raise ArithmeticError("t is no eigenvalue")
    return vector


def _multipliers(
    gradients: DigitArray, dual_coordinates: DigitArray, shared: bool
) -> DigitArray:
    """Return the multipliers: of sum 1, and of all solutions the nearest to equal ones.

    They solve Σ c_F gradient_F = λ_f S x_f for every f, with one λ if it is `shared`.

    Parameters
    ----------
    gradients
        Shape (sets, m, n).
    dual_coordinates
        The S x_f as columns, shape (m, n).
    shared
        Whether the model limits the mean norm of the columns, not each norm.
    """
    size, n = len(gradients), dual_coordinates.shape[1]
    # Each λ is multiplied with these, shape (m, n): all columns, or column f alone.
    normals = [dual_coordinates]
    if not shared:
        normals = [np.where(np.arange(n) == f, dual_coordinates, 0) for f in range(n)]
    # The unknowns are the c_F, then the λ. Equations: one for each entry, then Σ c_F = 1.
    columns = [one.ravel() for one in [*gradients, *(-normal for normal in normals)]]
    sums = [1] * size + [0] * len(normals)
    matrix = numbers(np.vstack([np.array(columns).T, sums]))
    right = numbers(np.eye(len(matrix))[-1])
    equal = np.array([mp.mpf(1) / size] * size + [mp.mpf(0)] * len(normals))
    return nearest_solution(matrix, right, equal)[:size]
