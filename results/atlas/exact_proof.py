"""The proof of an exact value, in exact arithmetic (docs/atlas_proofs.md, "Exact values").

What comes in: an entry of the atlas, its Jacobian J⁰ in double precision, and the record of an
exact Jacobian J, which `exact_optimum` describes. What is proved:

1. t is a root of the polynomial that is shown.
2. The exact Jacobian is of the model, has the eigenvalue t after each worst set F, and is
   stationary: Σ c_F ∇λ_F is a multiple of the gradient of the model.
3. t is the least eigenvalue of every A_F, and simple.
4. The exact Jacobian is next to that of the entry.
5. It is a strict local maximum: the one that the library proves to be next to the entry's
   Jacobian, or a sharp one.

The letters, f a joint and F a set of locked joints ("sets" is the number of worst sets):

- m, n: rows and columns of J. t: the squared worst case, σ² in units of J²;
- j_f = ±√w_f B x_f: column f of J, of shape (m,), with a frame B of shape (m, m);
- S = BᵀB: ``gram``, (m, m). x_f: columns of ``coordinates``, (m, n); S x_f: columns of
  ``dual_coordinates``, (m, n). w_f > 0: ``squared_scales``, (n,);
- A_F = JJᵀ without the columns in F, and λ_F: its least eigenvalue, t after each worst set;
- M_F = B⁻¹(A_F − tI)B⁻ᵀ: ``shifted_gram(F)``, (m, m). v_F: its null vector, a row of
  ``eigenvectors``, (sets, m); v_F·x_f: ``pairings``, (sets, n). u_F = B⁻ᵀv_F: eigenvector of
  A_F at t;
- c_F ≥ 0: ``multipliers``, (sets,), with Σ c_F |u_F|² = 1. ``active``: the numbers of the sets
  with c_F > 0; λ_f: multiplier of the model's condition on column f.

Arrays of these are of dtype object and hold exact `Number`. Fractions are bounds.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.atlas.exact_value import ISOLATION_RADIUS, has_one_root
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.bounds.rational_roots import root_below
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray
from results.atlas.enclosed_matrices import (
    Exact,
    distance_of_roots,
    has_full_rank,
    is_definite,
    norm_bound,
    rational,
)
from results.atlas.exact_optimum import ExactOptimum, LockedSet, Record, records, require
from results.atlas.number_field import Number

# The distance of the exact Jacobian from that of the entry, in the Frobenius norm, is less than
# this. A larger value lets a record pass whose Jacobian is another one than the file shows; a
# much smaller one refuses Jacobians that are rounded.
_SAME_JACOBIAN = Fraction(1, 10**7)
# A number below 2(√2 − 1) = 0.82842…, the constant of lemma 5.4 of Tu and others
# (arXiv:1507.03566). A number above that is wrong; a smaller one makes the bound larger.
_GRAM_CONSTANT = Fraction(828, 1000)


def prove_exact_value(
    entry: Entry,
    jacobian: FloatArray,
    maximum: LocalMaximum | None,
    record: Record | None = None,
) -> bool:
    """Prove what is on file of an entry, or raise CertificateError.

    Parameters
    ----------
    entry
        The entry.
    jacobian
        Its Jacobian, shape (m, n).
    maximum
        The local maximum that the library proves to be next to it; None if it proves none.
    record
        What is to be proved; by default what is on file. ``record["proof"]`` says how much:
        "numerical" the root of the polynomial only, "attained" the worst case of J,
        "sharp maximum" or "maximum" also that J is a strict local maximum.

    Returns
    -------
    bool
        Whether the exact Jacobian is proved to be a strict local maximum.
    """
    record = records()[entry.name] if record is None else record
    try:
        near = Fraction(record["near"])
        polynomial = record["polynomial"]
        isolated = has_one_root(polynomial, near, ISOLATION_RADIUS)
        require(isolated, "the polynomial has no root at σ²")
        if record["proof"] == "numerical":
            return False
        exact = ExactOptimum.of(entry, record)
        _require_root(exact.t, polynomial, near)
        _require_frame(exact)
        _require_model(exact)
        _require_stationary(exact)
        _require_least_eigenvalue(exact)
        signs = _column_signs(exact, jacobian)
        distance = _distance_bound(exact, jacobian * signs)
        require(distance < _SAME_JACOBIAN, "another Jacobian is on record")
        if record["proof"] == "attained":
            return False
        if record["proof"] == "sharp maximum":
            require(_is_sharp(exact), "it is no sharp maximum")
        elif maximum is None:
            require(False, "no local maximum is proved to be there")
        else:
            _require_same_maximum(exact, jacobian, signs, distance, maximum)
    except (ArithmeticError, IndexError, KeyError, TypeError, ValueError) as error:
        raise CertificateError(f"the exact value is not as it is written: {error}.") from None
    return True


def _require_root(t: Number, polynomial: Sequence[int], near: Fraction) -> None:
    """Require that t is the root of a polynomial, constant first, next to a rational number."""
    value, one = t.field.zero, t.field.one  # Horner's scheme
    for coefficient in reversed(polynomial):
        value = value * t + one.times(coefficient)
    _require_zero(value, "t is no root of the polynomial")
    require(t.distance_bound(near) < ISOLATION_RADIUS, "t is another root")


def _require_frame(exact: ExactOptimum) -> None:
    """Require that S is the Gram matrix of a frame, S⁻¹ its inverse, and every w_f > 0."""
    product = exact.gram @ exact.gram_inverse
    product[np.diag_indices(len(product))] -= exact.field.one
    _require_zero(product, "a matrix is not the inverse of the other")
    _require_zero(exact.gram - exact.gram.T, "a matrix is not symmetric")
    require(is_definite(exact.gram), "there is no frame")
    require(all(one.sign > 0 for one in exact.squared_scales), "a column has no length")


def _require_model(exact: ExactOptimum) -> None:
    """Require |j_f|² = w_f x_fᵀS x_f = 1 of all columns, or Σ |j_f|² = n."""
    n, one = exact.entry.joints, exact.field.one
    squared_lengths = exact.squared_scales * np.sum(
        exact.coordinates * exact.dual_coordinates, axis=0
    )
    if exact.entry.model == "free":
        _require_zero(squared_lengths - np.full(n, one), "a column is not of length 1")
    else:
        _require_zero(squared_lengths.sum() - one.times(n), "‖J‖² is not n")


def _require_stationary(exact: ExactOptimum) -> None:
    """Require that t is an eigenvalue after each worst set, and that J is stationary.

    The gradient of λ_F by j_f is, but for a factor, (v_F·x_f) v_F if f is not in F. With
    Σ c_F |u_F|² = 1, the conditions are Σ_{F∌f} c_F (v_F·x_f) v_F = λ_f S x_f for every f; all
    λ_f are equal if the columns share a budget.
    """
    n, zero, one = exact.entry.joints, exact.field.zero, exact.field.one
    gradient = np.full(exact.coordinates.shape, zero)
    total = -one
    for locked, vector, pairing, multiplier in zip(
        exact.worst_sets, exact.eigenvectors, exact.pairings, exact.multipliers, strict=True
    ):
        _require_zero(exact.shifted_gram(locked) @ vector, "t is no eigenvalue")
        part = vector[:, None] * pairing * multiplier
        part[:, list(locked)] = zero
        gradient = gradient + part
        total = total + multiplier * (vector @ exact.gram_inverse @ vector)
    _require_zero(total, "the sum of the multipliers is not 1")
    # The product of the condition with x_f, times w_f: λ_f |j_f|².
    scaled_lambdas = exact.squared_scales * np.sum(exact.coordinates * gradient, axis=0)
    if exact.entry.model == "free":  # |j_f| = 1
        rest = gradient - scaled_lambdas * exact.dual_coordinates
    else:  # one λ, and Σ |j_f|² = n
        rest = gradient * one.times(n) - exact.dual_coordinates * scaled_lambdas.sum()
    _require_zero(rest, "the gradient is not zero")


def _require_least_eigenvalue(exact: ExactOptimum) -> None:
    """Require that t is the least eigenvalue of A_F, and simple, after the worst sets only.

    M_F has as many negative and zero eigenvalues as A_F − tI. After a worst set its null vector
    is v_F: it is enough that M_F + v_F v_Fᵀ is positive definite. After all other sets M_F
    itself has to be.
    """
    number_of = {locked: number for number, locked in enumerate(exact.worst_sets)}
    for locked in combinations(range(exact.entry.joints), exact.entry.failures):
        matrix = exact.shifted_gram(locked)
        if locked in number_of:
            vector = exact.eigenvectors[number_of[locked]]
            require(any(one.sign for one in vector), "an eigenvector is zero")
            matrix = matrix + vector[:, None] * vector
        require(is_definite(matrix), "another eigenvalue is as small")


def _distance_bound(exact: ExactOptimum, jacobian: FloatArray) -> Fraction:
    """Return an upper bound on ‖J − J⁰‖_F, J the exact Jacobian in the frame nearest to J⁰.

    Lemma 5.4 of Tu and others: ‖J − J⁰‖² ≤ ‖JᵀJ − J⁰ᵀJ⁰‖²/(2(√2 − 1) σ_m(J)²), and here
    σ_m(J)² ≥ t. The entries of JᵀJ are (x_fᵀS x_g)√(w_f w_g).
    """
    products = rational(jacobian).T @ rational(jacobian)
    exact_products = exact.coordinates.T @ exact.dual_coordinates
    squares = np.outer(exact.squared_scales, exact.squared_scales)
    difference = distance_of_roots(products.ravel(), exact_products.ravel(), squares.ravel())
    t, error = exact.t.enclosed()
    return difference / root_below(_GRAM_CONSTANT * (t - error))


def _is_sharp(exact: ExactOptimum) -> bool:
    """Whether every change of J along the model, but of the frame, changes a λ_F with c_F > 0.

    Σ c_F dλ_F = 0 along the model, so that one of these λ_F falls to first order. The matrix
    has a row for each of these λ_F, each condition of the model and each change of frame. Its
    columns are the entries of the y_f, where dj_f = ±√w_f B y_f. Rows of changes of frame are
    normal to the others, which full rank therefore shows to vanish along changes of frame only.
    """
    m, n = exact.coordinates.shape
    zero = exact.field.zero
    model_gradient = exact.squared_scales * exact.dual_coordinates
    rows = [model_gradient]
    if exact.entry.model == "free":
        rows = [np.full((m, n), zero) for _ in range(n)]
        for f, row in enumerate(rows):
            row[:, f] = model_gradient[:, f]
    for number in exact.active:
        vector, pairing = exact.eigenvectors[number], exact.pairings[number]
        row = vector[:, None] * (exact.squared_scales * pairing)
        row[:, list(exact.worst_sets[number])] = zero
        rows.append(row)
    # A change of frame is y_f = S⁻¹K x_f with a skew matrix K.
    for a, b in combinations(range(m), 2):
        change = exact.gram_inverse[:, [a]] * exact.coordinates[b]
        rows.append(change - exact.gram_inverse[:, [b]] * exact.coordinates[a])
    return has_full_rank(np.reshape(np.array(rows), (-1, m * n)))


def _require_same_maximum(
    exact: ExactOptimum,
    jacobian: FloatArray,
    signs: FloatArray,
    distance: Fraction,
    maximum: LocalMaximum,
) -> None:
    """Require that J, in the frame nearest to J⁰, is the local maximum that the library proves.

    The library proves that its first-order conditions have one solution within `uniqueness` of
    its own numbers, in the largest difference. Its unknowns are J, p_F = √c_F u_F (`roots`),
    t (`level`), multipliers −2λ of the model's conditions (`weights`) and of the frame
    (`turns`). The exact optimum is a solution, with `turns` 0: so it is the same one if every
    number of it is so near.

    `signs`, shape (n,), makes J⁰ times `signs` agree with J; `distance` bounds ‖J − J⁰ signs‖.
    """
    number_of = {exact.worst_sets[number]: number for number in exact.active}
    tied = [_locked_set(row) for row in maximum.kept]
    require(sorted(tied) == sorted(number_of), "other sets are tied")
    numbers = [number_of[locked] for locked in tied]
    solved = rational(maximum.jacobian)
    moved = distance + norm_bound(solved - rational(jacobian))
    differences = [
        moved,
        _eigenvector_difference(exact, numbers, signs, moved, maximum),
        exact.t.distance_bound(Fraction(maximum.level)),
        *_multiplier_differences(exact, numbers, maximum),
        *map(abs, rational(maximum.turns)),
    ]
    same = max(differences) < Fraction(maximum.uniqueness)
    require(same, "it is another local maximum")


def _eigenvector_difference(
    exact: ExactOptimum,
    numbers: Sequence[int],
    signs: FloatArray,
    moved: Fraction,
    maximum: LocalMaximum,
) -> Fraction:
    """Return a bound on |p_F − p_F⁰| for all F; p_F = √c_F u_F, the index 0 is the library's.

    J⁰ is here the Jacobian of `maximum`, and `moved` bounds its distance from J. `numbers` are
    those of the sets F in the order of the rows of `maximum`.

    p_Fᵀj_f = ±√(c_F w_f) v_F·x_f. So |J⁰ᵀ(p_F − p_F⁰)| is at most the distance of these n
    numbers from p_F⁰ᵀj_f⁰, and `moved` more, since |p_F| ≤ 1. Singular values of J⁰ are at
    least √t − `moved`.
    """
    solved = rational(maximum.jacobian)
    farthest = Fraction(0)
    for number, root in zip(numbers, maximum.roots, strict=True):
        squares = exact.squared_scales * exact.multipliers[number]
        products = (rational(root) @ solved) * signs.astype(int)
        pairing = exact.pairings[number]
        # Both p and −p are solutions.
        side = 1 if products.astype(float) @ pairing.astype(float) >= 0 else -1
        farthest = max(farthest, distance_of_roots(products * side, pairing, squares))
    t, error = exact.t.enclosed()
    smallest_singular_value = root_below(t - error) - moved
    require(smallest_singular_value > 0, "it is another local maximum")
    return (farthest + moved) / smallest_singular_value


def _multiplier_differences(
    exact: ExactOptimum, numbers: Sequence[int], maximum: LocalMaximum
) -> list[Fraction]:
    """Return bounds on |ν_k − ν_k⁰|, ν_k = −2λ_k the multipliers of the model's conditions.

    ν⁰ are the `weights` of `maximum`. The product of the stationarity with j_f is λ_f |j_f|² =
    Σ_{F∌f} c_F w_f (v_F·x_f)², where |j_f| = 1 of columns that have each a condition.
    """
    n = exact.entry.joints
    lambdas = np.full(n, exact.field.zero)
    for number in numbers:
        pairing = exact.pairings[number]
        kept = [f for f in range(n) if f not in exact.worst_sets[number]]
        squares = exact.squared_scales[kept] * exact.multipliers[number]
        lambdas[kept] = lambdas[kept] + squares * pairing[kept] * pairing[kept]
    # Columns that share a budget, Σ |j_f|² = n, have one λ: the sum over n. `shared` is n then.
    shared = 1
    if exact.entry.model == "free-mean":
        lambdas, shared = np.array([lambdas.sum()]), n
    return [
        total.distance_bound(-shared * weight / 2) * 2 / shared
        for total, weight in zip(lambdas, rational(maximum.weights), strict=True)
    ]


def _column_signs(exact: ExactOptimum, jacobian: FloatArray) -> FloatArray:
    """Return ±1 for each column of J⁰, shape (n,), so that J⁰ᵀJ⁰ has the signs of JᵀJ.

    Signs are chosen one after the other, as in Prim's algorithm for a spanning tree: each by
    the largest entry that ties the column to those before. They are used, not trusted: wrong
    signs only make the distance of J from J⁰ too large.
    """
    # x_fᵀS x_g has the sign of j_f·j_g, as w_f and w_g are positive.
    exact_products = (exact.coordinates.T @ exact.dual_coordinates).astype(float)
    products = (rational(jacobian).T @ rational(jacobian)).astype(float)
    agreement = exact_products * products
    signs, size = np.zeros(len(agreement)), np.abs(agreement)
    signs[0] = 1.0
    while not signs.all():
        chosen, open_ = signs != 0, signs == 0
        i, j = np.unravel_index(np.argmax(size * np.outer(chosen, open_)), size.shape)
        if not open_[j]:  # all entries that tie are zero
            j = np.flatnonzero(open_)[0]
        signs[j] = signs[i] * (1.0 if agreement[i, j] >= 0 else -1.0)
    return signs


def _locked_set(kept: FloatArray) -> LockedSet:
    """Return the joints of a row, shape (n,), that are 0; those that are left are 1."""
    return tuple(np.flatnonzero(kept == 0).tolist())


def _require_zero(numbers: Exact | Number, why: str) -> None:
    """Require that one number, or all of an array, are exactly 0; CertificateError if not."""
    require(not np.asarray(numbers, dtype=object).astype(bool).any(), why)
