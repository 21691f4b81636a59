import platform
import subprocess
from dataclasses import replace
from functools import cache
from itertools import permutations, product

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.linalg import hadamard
from sympy.physics.quantum.cg import CG

from lockedjoint.formulations.bounds.moments import invariants
from lockedjoint.formulations.bounds.moments.block_values import (
    block_values,
    in_chunks,
    plain_norms,
)
from lockedjoint.formulations.bounds.moments.characters import invariant_dimension
from lockedjoint.formulations.bounds.moments.enclosed_matrix import gamma, rounded_once
from lockedjoint.formulations.bounds.moments.enclosed_squares import enclosed_block
from lockedjoint.formulations.bounds.moments.enclosed_sums import enclosed_sum
from lockedjoint.formulations.bounds.moments.moment_program import (
    moment_program,
    refined_multipliers,
)
from lockedjoint.formulations.bounds.moments.plain_rows import PlainRows
from lockedjoint.formulations.bounds.moments.predictor_corrector import (
    solve_with_predictor_corrector,
)
from lockedjoint.formulations.bounds.moments.relaxation import residual_values
from lockedjoint.formulations.bounds.moments.rotations import random_rotations
from lockedjoint.formulations.bounds.moments.row_rounding import (
    exchange_error,
    row_error,
    wigner_error,
)
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector, degree_sectors
from lockedjoint.formulations.bounds.moments.sampled_blocks import (
    BlockFamily,
    sector_families,
)
from lockedjoint.formulations.bounds.moments.wigner import wigner_matrices
from tests.formulations.bounds.moments import made_rotations as so3


def test_number_of_invariants_is_that_of_independent_functions():
    """Of degree 4: the constants and power sums over pairs of joints."""
    rotations = so3.haar_rotations(1, 60, 4)
    z = rotations[..., 0] + 1j * rotations[..., 1]
    w = np.abs(np.einsum("pia,pja->pij", z, z)) ** 2
    h = np.einsum("pia,pja->pij", z.conj(), z)
    functions = [np.ones((60, 4, 4)), w, (h**2).real, np.abs(h) ** 2]
    rank = np.linalg.matrix_rank([values.sum(axis=(1, 2)) for values in functions])
    assert rank == invariant_dimension(4, 4)


@pytest.fixture(scope="module")
def low():
    return sector_families(degree_sectors(4, range(3)), 7)


def configurations(seed, count, joints=7):
    return random_rotations(np.random.default_rng(seed), count, joints, extended=True)


def test_a_basis_bounds_an_invariant_everywhere():
    basis, points = invariants.invariant_basis(configurations(2, 80), (8, 0), 35, 50)
    assert len(points) == 50
    inside = residual_values(points).astype(float)
    bound = basis.largest_value(inside, np.zeros(50))
    largest = 5 * 49 / 3  # all columns alike
    assert largest < bound < 100 * largest
    assert bound < basis.largest_value(inside, np.full(50, 1e-3))


def test_points_that_are_needed_least_are_left_out():
    """The first one as if each had been tried; those that stay are better than at random."""
    rng = np.random.default_rng(31)
    values = rng.standard_normal((30, 12)) * rng.uniform(0.1, 3.0, (30, 1))
    tried = [np.linalg.norm(np.linalg.pinv(np.delete(values, k, axis=0))) for k in range(30)]
    kept = invariants._well_spread(values, 29)
    assert set(range(30)) - set(kept) == {int(np.argmin(tried))}
    many = rng.standard_normal((400, 60))
    at_random = [rng.choice(400, 75, replace=False) for _ in range(9)]
    size, *others = [
        np.linalg.norm(np.linalg.pinv(many[own]), 2)
        for own in (invariants._well_spread(many, 75), *at_random)
    ]
    assert size < 0.6 * np.median(others)


def test_the_basis_is_orthonormal_and_its_squares_are_bounded():
    functions = invariants.invariant_functions(4, 8)
    values = invariants.invariant_values(functions, configurations(20, 2000, 4), 8)
    assert values.shape[1] == invariant_dimension(4, 8)
    gram = values.T @ values / len(values)
    assert np.abs(np.diag(gram) - 1).max() < 0.3
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 0.3
    limit = float(sum(entry.largest_square for entry in functions))
    assert np.sum(values**2, axis=1).max() < limit
    alike = np.broadcast_to(np.eye(3), (1, 4, 3, 3))
    largest = np.sum(invariants.invariant_values(functions, alike, 8) ** 2)
    assert 0.03 * limit < largest < limit


def test_the_basis_is_invariant():
    functions = invariants.invariant_functions(7, 8)
    one = so3.haar_rotations(3, 1, 7)[0]
    both = invariants.invariant_values(functions, np.stack([one, so3.moved(one, 4)]), 8)
    assert np.abs(both[0] - both[1]).max() < 1e-11 * np.abs(both).max()


def test_rounding_is_bounded_by_the_absolute_values_of_the_left_inverse():
    """R · values is 0 with |R| · |values| as large as it can be, though ‖R‖₂ is 1."""
    left_inverse = hadamard(64)[1:] / 8.0
    values = np.ones(64)
    assert np.linalg.norm(left_inverse, 2) == pytest.approx(1)
    rounding = gamma(64) * np.linalg.norm(np.abs(left_inverse) @ values)
    bound = invariants.InvariantBasis(left_inverse, 0.0, 1.0).largest_value(
        values, np.zeros(64)
    )
    assert rounding < bound < 1.1 * rounding


def test_sums_are_enclosed_in_forty_digits():
    """Every row written out in mpmath, for every order of three joints."""
    family = BlockFamily(RowSector(2, 0, 1, 4), 3)
    rng = np.random.default_rng(3)
    roots = [rng.standard_normal((size, 2)) for size in family.sizes]
    pairs = zip(family.blocks, roots, strict=True)
    blocks = [enclosed_block(family, block, root) for block, root in pairs]
    found = enclosed_sum(family, blocks, configurations(4, 1, 3))
    quaternions = np.random.default_rng(4).standard_normal((3, 4))
    exact = exact_sum(family, blocks, quaternions)
    assert abs(found.values[0] - exact) < found.errors[0] < 1e-12 * exact


@cache
def exact_coupling(a, b, total):
    """Return Clebsch–Gordan coefficients with forty digits, (2a+1, 2b+1, 2·total+1)."""
    table = np.full((2 * a + 1, 2 * b + 1, 2 * total + 1), mpf(0), dtype=object)
    for i, k in product(range(-a, a + 1), range(-b, b + 1)):
        if abs(i + k) <= total:
            value = CG(a, i, b, k, total, i + k).doit().evalf(40)
            table[a + i, b + k, total + i + k] = mpf(value)
    return table


def exact_wigner(quaternion, largest):
    w, x, y, z = map(mpf, quaternion)
    # 2 (v vᵀ + w v×) + (w² − |v|²) I of a quaternion (w, v), over its square.
    v, cross = np.array([x, y, z]), np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = 2 * (np.outer(v, v) + w * cross) + (w * w - v @ v) * np.eye(3, dtype=int)
    rotation /= w * w + v @ v
    half = mp.sqrt(2) / 2
    unit = np.array([[half, 0, -half], [-half * 1j, 0, -half * 1j], [0, mpf(1), 0]])
    one = np.vectorize(mp.conj, otypes=[object])(unit).T @ rotation @ unit
    found = [np.array([[mpf(1)]]), one]
    for spin in range(1, largest):
        table = exact_coupling(spin, 1, spin + 1).reshape(-1, 2 * spin + 3)
        found.append(table.T @ np.kron(found[spin], one) @ table)
    return found


def exactly_coupled(columns, goal):
    """Couple vectors in sequence, in the order of the library."""
    partial = {len(columns[0]) // 2: [columns[0]]}
    for place, column in enumerate(columns[1:], start=1):
        spin, rest = len(column) // 2, sum(len(other) // 2 for other in columns[place + 1 :])
        grown: dict = {}
        for before, ways in partial.items():
            for total in range(abs(before - spin), min(before + spin, goal + rest) + 1):
                table = exact_coupling(before, spin, total)
                new = (np.tensordot(np.multiply.outer(way, column), table, 2) for way in ways)
                grown.setdefault(total, []).extend(new)
        partial = grown
    return partial.get(goal, [])


def exact_sum(family, blocks, quaternions):
    """Return Σ_T |A_Tᵀφ|² of all blocks, its mean over all orders, with forty digits."""
    mp.dps = 40
    functions = [exact_wigner(quaternion, family.largest_spin) for quaternion in quaternions]
    total, orders = mpf(0), list(permutations(range(family.joints)))

    def values_of(rows, order):
        ways = []
        for assignment in rows.assignments:
            places = zip(rows.labels, assignment, strict=True)
            columns = [functions[order[j]][spin][:, spin + m] for (spin, m), j in places]
            ways += exactly_coupled(columns, family.sector.spin)
        return np.array(ways)

    for order in orders:
        plain = [values_of(rows, order) for rows in family.rows]
        for block in blocks:
            values = exact_values(block, plain)
            total += sum(abs(value) ** 2 for value in values.ravel()) / block.tableaux
    return total / len(orders) / (2 * family.sector.spin + 1)


def exact_values(block, plain, kind=object):
    """Return (U L)ᵀφ of plain rows (rows, components), its numbers of another kind."""
    total = 0
    for number, place, basis in block.parts:
        rows = (basis.astype(kind) @ plain[number]).reshape(
            block.tableaux, place.stop - place.start, -1
        )
        total = total + np.tensordot(rows, block.factors[0][place].astype(kind), axes=(1, 0))
    return total


def test_rows_that_are_not_symmetric_are_noticed():
    family = BlockFamily(RowSector(2, 0, 1, 4), 6)
    block = max(family.blocks, key=lambda block: block.tableaux)
    good = enclosed_block(family, block, np.eye(block.size))
    block.parts[0][2][0] *= 1.001
    assert enclosed_block(family, block, np.eye(block.size)).differences.max() > 1e-3
    assert good.differences.max() < 1e-12


def test_refined_multipliers_satisfy_the_equations_better(low):
    samples = so3.haar_rotations(8, 160, 7)
    blocks = [block for family in low for block in family.evaluate(samples)]
    program = moment_program([blocks], -residual_values(samples))
    rough = solve_with_predictor_corrector(program, gap=1e-3, accuracy=1e-3).multipliers
    assert rough is not None
    rng = np.random.default_rng(9)
    noisy = [x + 1e-7 * x @ np.diag(rng.standard_normal(len(x))) @ x for x in rough]
    noisy = [0.5 * (x + x.T) for x in noisy]
    fine = refined_multipliers(program, noisy)
    before = np.abs(program.dual_residual(noisy)).max()
    assert np.abs(program.dual_residual(fine)).max() < 1e-3 * before
    assert min(np.linalg.eigvalsh(x)[0] for x in fine) > -1e-12


def test_errors_of_wigner_functions_and_rows_stay_below_their_bounds():
    rotations = configurations(5, 50, 1)[:, 0]
    for spin, matrix in enumerate(wigner_matrices(rotations, 6)):
        unit = matrix @ matrix.conj().swapaxes(-1, -2) - np.eye(2 * spin + 1)
        assert np.linalg.norm(unit, 2, axis=(-2, -1)).max() <= 2.1 * wigner_error(spin) + 1e-14
    rows = PlainRows((((1, 1),) * 6, ()), (range(6), range(6, 7)), 0)
    assert 1e-15 < row_error(rows) < 1e-13
    assert 1e-19 < exchange_error(rows) < 1e-15
    unit = np.eye(rows.length)
    twice = (rows.exchanged(2, rows.exchanged(2, unit)) - unit).astype(float)
    assert 0 < np.linalg.norm(twice, 2) < 3 * exchange_error(rows)
    np.testing.assert_allclose(rows.exchanged(2, unit), rows.exchanges[2].toarray(), atol=1e-15)


@pytest.mark.parametrize("scale", [1e4, 1e-3])
def test_products_with_rows_are_rounded_once_where_multipliers_are_large(scale):
    """Sums in extended precision are as good as exact: K of them are 2000 times better."""
    family, rng = BlockFamily(RowSector(None, 2, 1, 4), 6), np.random.default_rng(5)
    plain = family.plain_values(wigner_matrices(configurations(7, 9, 6), 4), range(6))
    for block in family.blocks:
        root = rng.standard_normal((block.size, 3)) * 10.0 ** rng.integers(-3, 3, 3)
        own = enclosed_block(family, block, scale * root)
        assert (own.bits > 0) == (scale > 1)
        (values,) = in_chunks(plain, 9)
        for number, _, basis in own.parts * (own.bits > 0):
            found = rounded_once(basis, values[number], own.bits)
            exact = basis.astype(np.longdouble) @ values[number]
            assert np.all(np.abs(found - exact) <= 1.2e-16 * np.abs(exact) + 1e-18)
        found = block_values(own, values, 6)
        flat = [rows.astype(np.longdouble) for rows in values]
        exact = exact_values(own, flat, np.longdouble).swapaxes(1, 2).reshape(found.shape[1:])
        off = np.sqrt(np.sum((found[0] - exact) ** 2, axis=(0, 1)).astype(float))
        norms = plain_norms(family, plain)
        (allowed,) = replace(own, fixed=0 * own.fixed).mistakes(norms)
        assert np.all(off <= allowed)
        limit = 1e-13 if own.bits else 1e-12
        assert np.all(allowed < limit * np.abs(own.factors).max() * norms.max(axis=0))
        assert off.max() > 0


SET_PRECISION = """
void set_precision(unsigned short word) {__asm__ volatile ("fldcw %0" :: "m" (word));}
"""
TRIED = """
import ctypes
from lockedjoint.formulations.bounds.moments import enclosed_matrix, enclosed_sums
from lockedjoint.nlp.errors import LockedJointError
enclosed_matrix.require_extended_precision()
library = ctypes.CDLL({library!r})
for word, named in ((0x027F, "53 bits"), (0x007F, "24 bits"), (0x037F, "64 bits")):
    library.set_precision(ctypes.c_ushort(word))
    refused = []
    for ask in (enclosed_matrix.require_extended_precision,
                lambda: enclosed_sums.enclosed_sum(None, [], [])):
        try:
            ask()
        except enclosed_matrix.NoExtendedPrecisionError:
            refused.append(True)
        except (AttributeError, TypeError):
            refused.append(False)
    print(named, refused)
"""


@pytest.mark.compiler
@pytest.mark.skipif(platform.machine() not in ("x86_64", "i686"), reason="of x87")
def test_the_precision_of_the_processor_is_tried(tmp_path, lockedjoint):
    """Where another library has set x87 to 53 bits, though the format has 64."""
    (tmp_path / "x87.c").write_text(SET_PRECISION)
    command = ["cc", "-shared", "-fPIC", "-o", "x87.so", "x87.c"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=60)
    said = lockedjoint.python(TRIED.format(library=str(tmp_path / "x87.so")))
    assert "53 bits [True, True]" in said
    assert "24 bits [True, True]" in said
    assert "64 bits [False" in said or "64 bits []" in said
