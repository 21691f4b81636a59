"""Find exact values for the atlas: Newton's method to many digits, then integer relations.

    pip install cypari && python results/atlas/exact.py [--digits 1500] [ENTRY ...]

writes formulations/atlas/exact.json anew, or only the entries named. PARI/GP is needed here
only: `lockedjoint atlas verify` proves what is found, in whole numbers. Polynomials of degree
11 and more, that of unit revolute 7R among them, need 1500 digits.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import scipy.linalg
import scipy.optimize
from cypari import pari

from formulations import max_min
from formulations.atlas.collection import proved_maximum, read_atlas
from formulations.atlas.entry import EntryPage, entries
from formulations.atlas.exact_optimum import prove_exact_value
from formulations.atlas.local_maximum import LocalMaximum, _Conditions
from formulations.atlas.local_optimality import null_space, worst_failures
from formulations.existence.certificate import CertificateError

_FILE = Path(__file__).parents[2] / "formulations" / "atlas" / "exact.json"
_DEGREES = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32)
_CHOICES = 4
# Degrees of the fields that exact proofs are tried in.
_LARGEST = 10


def main() -> None:
    """Find the exact values of some entries, or of all, and write them."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("entries", nargs="*", metavar="ENTRY", help="by default all")
    # Relations are sought with all but the last tenth of the digits, must have a quarter fewer
    # themselves, and must hold to all of them.
    options.add_argument("--digits", type=int, nargs="+", default=[320, 1000], metavar="D")
    given = options.parse_args()
    records = json.loads(_FILE.read_text()) if _FILE.is_file() else {}
    for page in read_atlas():
        name = page.entry.name
        isolated = page.family == 0 and page.entry.formulation == max_min.NAME
        if not isolated or (given.entries and name not in given.entries):
            continue
        records.pop(name, None)
        for digits in given.digits if page.entry.model.startswith("free") else given.digits[:1]:
            mp.mp.dps = digits
            pari.set_real_precision(digits)
            try:
                records[name] = found(page)
                said = (
                    f"degree {len(records[name]['polynomial']) - 1}, {records[name]['proof']}"
                )
            except (ArithmeticError, CertificateError) as error:
                said = str(error)
            print(name, f"{digits} digits:", said, flush=True)
            if name in records and records[name]["proof"] != "numerical":
                break
        listed = [k for k in entries() if k in records]
        lines = ",\n".join(f"{json.dumps(k)}: {json.dumps(records[k])}" for k in listed)
        _FILE.write_text(f"{{\n{lines}\n}}\n")


def found(page: EntryPage) -> dict[str, Any]:
    """Return the record of an entry, or raise ArithmeticError."""
    maximum = proved_maximum(page.entry, page.jacobian)
    jacobian, t = solution(page, maximum)
    polynomial = algebraic(t)
    record = {"polynomial": polynomial, "near": mp.nstr(t, 20), "proof": "numerical"}
    if not page.entry.model.startswith("free"):
        return record
    try:
        kept = None if maximum is None else maximum.kept
        exact = {**record, **exact_optimum(page, jacobian, t, polynomial, kept)}
    except ArithmeticError as error:
        print("  ", page.entry.name, error)
        return record
    for proof in ("maximum", "attained"):
        try:
            stated = {**exact, "proof": proof}
            prove_exact_value(page.entry, page.jacobian, maximum, stated)
            return stated
        except CertificateError as error:
            print("  ", page.entry.name, error)
    return record


def solution(page: EntryPage, maximum: LocalMaximum | None) -> tuple[Any, Any]:
    """Return J and t to all digits: Newton's method with one inverse in double precision."""
    why = "no conditions"
    for choice in range(_CHOICES):
        try:
            conditions = _Conditions(page.entry, page.jacobian, choice)
            if maximum is None:
                _take_all(conditions, page)
            elif not np.array_equal(conditions.kept, maximum.kept):
                continue
            x = conditions.solution()
        except (CertificateError, np.linalg.LinAlgError) as error:
            why = str(error)
            continue
        slope = conditions.slope(x)
        # Multipliers that are not unique leave a null space; steps are normal to it.
        inverse = np.linalg.pinv(slope, rcond=1e-10)
        start = np.array([mp.mpf(float(v)) for v in x], dtype=object)
        for _ in range(mp.mp.dps):
            rest = _gradient(conditions, start)
            largest = max(abs(v) for v in rest)
            if largest < mp.mpf(10) ** (8 - mp.mp.dps):
                j, _, _, t, _ = conditions.parts(start)
                return mp.matrix(j.tolist()), t
            scaled = np.array([float(v / largest) for v in rest])
            start = start - largest * (inverse @ scaled)
            if largest > 1:
                break
        why = "Newton's method does not converge"
    raise ArithmeticError(why)


def _take_all(conditions: _Conditions, page: EntryPage) -> None:
    """Let all sets at the worst case have multipliers above zero: the least as large as can be.

    Then their eigenvalues are equations, also where multipliers are not unique.
    """
    failures = worst_failures(page.jacobian, page.entry.locked)
    pulls = [2 * one.active @ (one.active.T @ one.rest) for one in failures]
    normals = np.array([one.gradient(page.jacobian).ravel() for one in conditions.model])
    tangents = null_space(list(normals))
    columns = tangents @ np.reshape(pulls, (len(pulls), -1)).T
    # Least squares of what is left, as what is on file is not exact.
    left, tied = np.linalg.svd(columns)[1:]
    free = tied[int(np.sum(left > 1e-4)) :]
    size = len(free)
    found = scipy.optimize.linprog(
        np.append(np.zeros(size), -1.0),
        A_ub=np.hstack([-free.T, np.ones((len(pulls), 1))]),
        b_ub=np.zeros(len(pulls)),
        A_eq=[np.append(free.sum(axis=1), 0.0)],
        b_eq=[1.0],
        bounds=[(None, None)] * (size + 1),
    )
    if found.status or found.x[-1] <= 1e-6:
        raise CertificateError("some multipliers are zero")
    y = free.T @ found.x[:-1]
    conditions.kept = np.array([one.kept for one in failures])
    roots = [np.sqrt(v) * one.active[:, 0] for v, one in zip(y, failures, strict=True)]
    conditions.roots = np.array(roots)
    pull = np.tensordot(y, pulls, axes=1).ravel()
    conditions.weights = -np.linalg.lstsq(normals.T, pull)[0]


def _gradient(conditions: _Conditions, x: Any) -> Any:
    """The gradient of G as `_Conditions.gradient` has it, in numbers of many digits."""
    j, p, w, t, mu = conditions.parts(x)
    normals = []
    for one in conditions.model:
        rows, columns = np.nonzero(one.form)
        normal = one.linear.astype(object)
        for a, b in zip(rows, columns, strict=True):
            normal[a] = normal[a] + float(one.form[a, b]) * j.ravel()[b]
        normals.append(normal)
    linear = np.array([one.linear for one in conditions.model]).astype(object)
    levels = np.array([one.level for one in conditions.model]).astype(object)
    normal = np.array(normals, dtype=object).reshape(len(conditions.model), j.size)
    rest = j * conditions.kept[:, None].astype(object)
    frames, fixed = conditions.frames.astype(object), conditions.fixed.astype(object)
    pulled = np.sum(p[:, :, None] * rest, axis=1)
    by_j = 2 * p.T @ pulled + (w @ normal).reshape(j.shape)
    by_j = by_j - np.sum(mu[:, None, None] * frames, axis=0)
    by_p = 2 * (np.sum(rest * pulled[:, None], axis=2) - t * p)
    by_w = (normal + linear) @ j.ravel() / 2 - levels
    by_mu = -np.sum(frames * (j - fixed), axis=(1, 2))
    return np.concatenate([by_j.ravel(), by_p.ravel(), by_w, [1 - np.sum(p * p)], by_mu])


def relation(values: list[Any]) -> list[int] | None:
    """Return whole numbers c with Σ c_i x_i = 0, None if none is significant."""
    digits = mp.mp.dps
    rows = [pari(mp.nstr(value, digits)) for value in values]
    c = [int(v) for v in pari(rows).lindep(int(0.9 * digits))]
    size = sum(len(str(abs(v))) for v in c)
    left = abs(mp.fsum(a * x for a, x in zip(c, values, strict=True)))
    fits = left < mp.mpf(10) ** (15 - digits) * max(map(abs, c)) * mp.fsum(map(abs, values))
    return c if fits and size < 0.75 * 0.9 * digits else None


def algebraic(x: Any, degrees: tuple[int, ...] = _DEGREES) -> list[int]:
    """Return the irreducible polynomial in whole numbers of a number, or ArithmeticError."""
    for degree in degrees:
        c = relation([x**i for i in range(degree + 1)])
        if c is not None:
            factors = pari(c[::-1]).Pol().factor()[0]
            parts = [[int(v) for v in one.Vecrev()] for one in factors]
            best = min(parts, key=lambda one: abs(mp.polyval(one[::-1], x)))
            return best if best[-1] > 0 else [-v for v in best]
    raise ArithmeticError(f"no relation of a degree up to {degrees[-1]}")


@dataclass
class _Pool:
    """Numbers of a field on the basis 1, θ, …, each once."""

    theta: Any
    degree: int

    def __post_init__(self) -> None:
        self.values: list[Any] = []
        self.numbers: list[list[int]] = []

    def place(self, x: Any) -> int:
        """Return the place of a number, recognised where it is new."""
        for place, known in enumerate(self.values):
            if abs(x - known) < mp.mpf(10) ** (-mp.mp.dps // 3):
                return place
        self.numbers.append(self._stated(x))
        self.values.append(x)
        return len(self.values) - 1

    def _stated(self, x: Any) -> list[int]:
        if abs(x) < mp.mpf(10) ** (-mp.mp.dps // 2):
            return [0] * self.degree + [1]
        c = relation([x, *(self.theta**i for i in range(self.degree))])
        if c is None or c[0] == 0:
            raise ArithmeticError(f"{mp.nstr(x, 12)} is not of the field")
        side = -1 if c[0] > 0 else 1
        return [side * v for v in c[1:]] + [abs(c[0])]

    def places(self, values: Any) -> Any:
        """Return the places of numbers in nested lists."""
        if isinstance(values, list):
            return [self.places(value) for value in values]
        return self.place(values)


def exact_optimum(
    page: EntryPage, jacobian: Any, t: Any, polynomial: list[int], kept: Any
) -> dict[str, Any]:
    """Return what a proof needs, or raise ArithmeticError where numbers are not recognised."""
    metric, columns, weights = invariants(jacobian)
    inverse = metric**-1
    scalars = [t, *metric, *columns, *weights]
    failures = worst_failures(page.jacobian, page.entry.locked)
    sets = [tuple(int(v) for v in np.flatnonzero(one.kept == 0)) for one in failures]
    vectors = [_kernel(metric, columns, weights, t, lost) for lost in sets]
    active = list(range(len(sets)))
    if kept is not None:
        left = {tuple(np.flatnonzero(row == 0).tolist()) for row in kept}
        active = [k for k, lost in enumerate(sets) if lost in left]
    own, lost_sets = [vectors[k] for k in active], [sets[k] for k in active]
    found = _multipliers(metric, columns, own, lost_sets, page.entry.model == "free")
    multipliers = [mp.mpf(0)] * len(sets)
    for k, value in zip(active, found, strict=True):
        multipliers[k] = value
    why = ""
    for theta, field in fields(t, polynomial, scalars):
        pool = _Pool(theta, len(field) - 1)
        try:
            pool.place(t)
            stated = {
                "metric": pool.places(metric.tolist()),
                "inverse": pool.places(inverse.tolist()),
                "columns": pool.places(columns.tolist()),
                "weights": pool.places(weights),
                "sets": sets,
                "vectors": pool.places(vectors),
                "multipliers": pool.places(multipliers),
            }
        except ArithmeticError as error:
            why = str(error)
            continue
        near = Fraction(int(mp.nint(theta * 10**15)), 10**15)
        root = [str(near), "1/100000000000000"]
        return {"field": field, "root": root, "numbers": pool.numbers, **stated}
    raise ArithmeticError(f"{why} ({len(sets)} sets)")


def fields(
    t: Any, polynomial: list[int], scalars: list[Any]
) -> Iterator[tuple[Any, list[int]]]:
    """Yield generators θ and their monic polynomials: of Q(t), or of a larger field."""
    degree = len(polynomial) - 1
    if degree == 1:
        yield mp.mpf(0), [0, 1]
    else:
        yield from _reduced(t, polynomial)
    # Numbers whose polynomials are small, and of which t is one.
    for multiple in (2, 1) if degree == 1 else (1, 2):
        size = multiple * degree
        if size > _LARGEST or size == 1:
            continue
        sums = [x + t for x in scalars] if multiple == 2 else []
        for x in [*scalars, *sums]:
            try:
                own = algebraic(x, (size,))
            except ArithmeticError:
                continue
            if len(own) - 1 == size and relation([t, *(x**i for i in range(size))]):
                yield from _reduced(x, own)
                break


def _reduced(x: Any, polynomial: list[int]) -> Iterator[tuple[Any, list[int]]]:
    """Yield a generator of the same field with a small monic polynomial."""
    small = [int(v) for v in pari(polynomial[::-1]).Pol().polredbest().Vecrev()]
    for theta in mp.polyroots(small[::-1], maxsteps=2000, extraprec=4 * mp.mp.prec):
        if abs(mp.im(theta)) < mp.mpf(10) ** (-mp.mp.dps // 2):
            theta = mp.re(theta)
            if relation([x, *(theta**i for i in range(len(small) - 1))]):
                yield theta, small


def invariants(jacobian: Any) -> tuple[Any, Any, list[Any]]:
    """Return S, the x_f and w_f, which neither a frame nor signs of columns change.

    The frame are columns of J, scaled such that entries of the x_f along a tree are 1.
    """
    m, n = jacobian.rows, jacobian.cols
    doubles = np.array(jacobian.tolist(), dtype=float)
    basis: list[int] = []
    for f in range(n):
        chosen = doubles[:, [*basis, f]]
        if len(basis) < m and np.linalg.svd(chosen, compute_uv=False)[-1] > 0.1:
            basis.append(f)
    frame = mp.matrix([[jacobian[i, f] for f in basis] for i in range(m)])
    columns, gram = frame**-1 * jacobian, frame.T * frame
    zero = mp.mpf(10) ** (-mp.mp.dps // 3)
    rows: dict[int, Any] = {0: mp.mpf(1)}
    scales: dict[int, Any] = {}
    while len(rows) < m or len(scales) < n:
        links = [
            (i, f)
            for i in range(m)
            for f in range(n)
            if (i in rows) != (f in scales) and abs(columns[i, f]) > zero
        ]
        if links:
            i, f = links[0]
            if i in rows:
                scales[f] = 1 / (rows[i] * columns[i, f])
            else:
                rows[i] = 1 / (scales[f] * columns[i, f])
            continue
        i = next(i for i in range(m) if i not in rows)
        tied = [k for k in rows if abs(gram[i, k]) > zero]
        rows[i] = (
            gram[i, tied[0]] / (gram[tied[0], tied[0]] / rows[tied[0]]) if tied else mp.mpf(1)
        )
    for i in range(m):
        for f in range(n):
            columns[i, f] = columns[i, f] * rows[i] * scales[f]
    metric = mp.matrix([[gram[i, k] / (rows[i] * rows[k]) for k in range(m)] for i in range(m)])
    return metric, columns, [1 / scales[f] ** 2 for f in range(n)]


def _kernel(
    metric: Any, columns: Any, weights: Any, t: Any, lost: tuple[int, ...]
) -> list[Any]:
    """Return v_F, its last entry that is not zero 1."""
    m, n = columns.rows, columns.cols
    rest = -t * metric**-1
    for f in range(n):
        if f not in lost:
            rest = rest + weights[f] * columns[:, f] * columns[:, f].T
    doubles = np.array(rest.tolist(), dtype=float)
    pivots = scipy.linalg.qr(doubles, pivoting=True, mode="r")[1]
    # Solve for the others with one at 1: the one the factors find last.
    fixed, others = int(pivots[-1]), sorted(int(v) for v in pivots[:-1])
    square = mp.matrix([[rest[i, k] for k in others] for i in others])
    right = mp.matrix([-rest[i, fixed] for i in others])
    found = mp.lu_solve(square, right)
    vector = [mp.mpf(1)] * m
    for k, value in zip(others, found, strict=True):
        vector[k] = value
    if max(abs(v) for v in rest * mp.matrix(vector)) > mp.mpf(10) ** (-mp.mp.dps // 2):
        raise ArithmeticError("t is no eigenvalue")
    return vector


def _multipliers(
    metric: Any, columns: Any, vectors: list[Any], sets: list[tuple[int, ...]], unit: bool
) -> list[Any]:
    """Return the c_F: of sum 1, and of all solutions the nearest to equal ones."""
    m, n = columns.rows, columns.cols
    covered = metric * columns
    shared = n if unit else 1
    rows = [[mp.mpf(0)] * (len(sets) + shared) for _ in range(m * n + 1)]
    for k, (vector, lost) in enumerate(zip(vectors, sets, strict=True)):
        rows[-1][k] = mp.mpf(1)
        for f in range(n):
            if f not in lost:
                pull = mp.fsum(vector[i] * columns[i, f] for i in range(m))
                for i in range(m):
                    rows[i * n + f][k] = pull * vector[i]
    for f in range(n):
        for i in range(m):
            rows[i * n + f][len(sets) + (f if unit else 0)] = -covered[i, f]
    doubles = np.array(rows, dtype=float)
    kept = list(range(len(sets)))
    r, order = scipy.linalg.qr(doubles.T, pivoting=True, mode="r")
    rank = int(np.sum(np.abs(np.diag(r)) > 1e-7 * abs(r[0, 0])))
    chosen = sorted(int(v) for v in order[:rank])
    if len(rows) - 1 not in chosen:
        chosen[-1] = len(rows) - 1
    right = [mp.mpf(1 if i == len(rows) - 1 else 0) for i in chosen]
    part = mp.matrix([rows[i] for i in chosen])
    start = mp.matrix([mp.mpf(1) / len(sets)] * len(sets) + [mp.mpf(0)] * shared)
    step = part.T * mp.lu_solve(part * part.T, mp.matrix(right) - part * start)
    found = start + step
    if max(abs(v) for v in mp.matrix(rows) * found - mp.matrix([0] * (m * n) + [1])) > mp.mpf(
        10
    ) ** (-mp.mp.dps // 3):
        raise ArithmeticError("there are no multipliers")
    return [found[k] for k in kept]


if __name__ == "__main__":
    main()
