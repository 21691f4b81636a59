"""Find exact values for the atlas: Newton's method to many digits, then integer relations.

    pip install cypari && python results/atlas/exact.py [--digits 1500] [ENTRY ...]

writes formulations/atlas/exact.json anew, or only the entries named. PARI/GP is needed here
only: `lockedjoint atlas verify` proves what is found, in whole numbers. Polynomials of degree
11 and more, that of unit revolute 7R among them, need 1500 digits.
"""

import argparse
import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
from cypari import pari

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.collection import proved_maximum, read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage, entries
from lockedjoint.formulations.atlas.exact_optimum import prove_exact_value
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.atlas.local_optimality import worst_failures
from lockedjoint.formulations.existence.certificate import CertificateError
from results.atlas import many_digits
from results.atlas.many_digits import Pool, nearest_solution, numbers, small

_FILE = Path(__file__).parents[2] / "formulations" / "atlas" / "exact.json"


def main() -> None:
    """Find the exact values of some entries, or of all, and write them."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("entries", nargs="*", metavar="ENTRY", help="by default all")
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
                record = records[name] = found(page)
                said = f"degree {len(record['polynomial']) - 1}, {record['proof']}"
            except ArithmeticError as error:
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
    jacobian, t = many_digits.solution(page, maximum)
    polynomial = many_digits.algebraic(t)
    record = {"polynomial": polynomial, "near": mp.nstr(t, 20), "proof": "numerical"}
    if not page.entry.model.startswith("free"):
        return record
    try:
        exact = {**record, **exact_optimum(page, jacobian, t, polynomial, maximum)}
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


def exact_optimum(
    page: EntryPage, jacobian: Any, t: Any, polynomial: list[int], maximum: LocalMaximum | None
) -> dict[str, Any]:
    """Return what a proof needs, or raise ArithmeticError where numbers are not recognised."""
    metric, columns, weights = invariants(jacobian)
    inverse = _inverted(metric)
    failures = worst_failures(page.jacobian, page.entry.locked)
    kept = np.array([one.kept for one in failures])
    products = weights * columns[:, None] * columns
    vectors = np.array([_kernel(products @ row - t * inverse) for row in numbers(kept)])
    active = np.ones(len(kept), dtype=bool)
    if maximum is not None:
        active = (kept[:, None] == maximum.kept).all(axis=2).any(axis=1)
    multipliers = numbers(np.zeros(len(kept)))
    # Of unit vectors u_F = B⁻ᵀv_F: multipliers that add up to 1.
    sizes = np.sum(vectors @ inverse * vectors, axis=1)
    pulls = vectors[:, :, None] * (vectors @ columns * kept)[:, None] / sizes[:, None, None]
    shared = page.entry.model != "free"
    own = _multipliers(pulls[active], metric @ columns, shared)
    multipliers[active] = own / sizes[active]
    why = ""
    scalars = [t, *metric.ravel(), *columns.ravel(), *weights]
    for theta, field in many_digits.fields(t, polynomial, scalars):
        pool = Pool(theta, len(field) - 1)
        try:
            pool.place(t)
            stated = {
                "metric": pool.places(metric),
                "inverse": pool.places(inverse),
                "columns": pool.places(columns),
                "weights": pool.places(weights),
                "sets": [np.flatnonzero(row == 0).tolist() for row in kept],
                "vectors": pool.places(vectors),
                "multipliers": pool.places(multipliers),
            }
        except ArithmeticError as error:
            why = str(error)
            continue
        near = Fraction(int(mp.nint(theta * 10**15)), 10**15)
        root = [str(near), "1/100000000000000"]
        return {"field": field, "root": root, "numbers": pool.numbers, **stated}
    raise ArithmeticError(f"{why} ({len(kept)} sets)")


def invariants(jacobian: Any) -> tuple[Any, Any, Any]:
    """Return S, the x_f and w_f, which neither a frame nor signs of columns change.

    The frame are columns of J, scaled such that entries of the x_f along a tree are 1.
    """
    m, n = jacobian.shape
    basis: list[int] = []
    for f in range(n):
        chosen = jacobian[:, [*basis, f]].astype(float)
        if len(basis) < m and np.linalg.svd(chosen, compute_uv=False)[-1] > 0.1:
            basis.append(f)
    frame = jacobian[:, basis]
    columns, gram = _inverted(frame) @ jacobian, frame.T @ frame
    linked = np.abs(columns) > small(3)
    rows: dict[int, Any] = {0: mp.mpf(1)}
    scales: dict[int, Any] = {}
    while len(rows) < m or len(scales) < n:
        links = [(i, f) for i, f in np.argwhere(linked) if (i in rows) != (f in scales)]
        if links and links[0][0] in rows:
            i, f = links[0]
            scales[f] = 1 / (rows[i] * columns[i, f])
        elif links:
            i, f = links[0]
            rows[i] = 1 / (scales[f] * columns[i, f])
        else:
            i = next(i for i in range(m) if i not in rows)
            tied = [k for k in rows if abs(gram[i, k]) > small(3)]
            rows[i] = gram[i, tied[0]] * rows[tied[0]] / gram[tied[0], tied[0]] if tied else 1
    down, along = np.array([rows[i] for i in range(m)]), np.array([scales[f] for f in range(n)])
    columns = columns * down[:, None] * along
    return gram / (down[:, None] * down), columns, 1 / along**2


def _inverted(matrix: Any) -> Any:
    inverse = mp.matrix(matrix.tolist()) ** -1
    return np.array(inverse.tolist(), dtype=object).reshape(matrix.shape)


def _kernel(matrix: Any) -> Any:
    """Return a vector that a symmetric matrix maps to zero, with an entry 1."""
    place = int(np.abs(np.linalg.svd(matrix.astype(float))[2][-1]).argmax())
    unit = numbers(np.eye(len(matrix))[place])
    vector = _inverted(matrix + np.outer(unit, unit)) @ unit
    if max(abs(v) for v in matrix @ vector) > small(2):
        raise ArithmeticError("t is no eigenvalue")
    return vector


def _multipliers(pulls: Any, covered: Any, shared: bool) -> Any:
    """Return the multipliers: of sum 1, and of all solutions the nearest to equal ones."""
    size, n = len(pulls), covered.shape[1]
    parts = [covered] if shared else [np.where(np.arange(n) == f, covered, 0) for f in range(n)]
    rows = [one.ravel() for one in [*pulls, *(-part for part in parts)]]
    sums = [1] * size + [0] * len(parts)
    matrix = numbers(np.vstack([np.array(rows).T, sums]))
    right = numbers(np.eye(len(matrix))[-1])
    start = np.array([mp.mpf(1) / size] * size + [mp.mpf(0)] * len(parts))
    return nearest_solution(matrix, right, start)[:size]


if __name__ == "__main__":
    main()
