from __future__ import annotations

from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import hadamard

from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    enclosed_block,
    enclosed_sums,
)
from formulations.bounds.so3_moments.blocks.invariants import (
    InvariantBasis,
    NoBasisError,
    invariant_basis,
    invariant_dimension,
)
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks, sector_families
from formulations.bounds.so3_moments.programs.moment_program import moment_program
from formulations.bounds.so3_moments.programs.multipliers import refined_multipliers
from formulations.bounds.so3_moments.programs.predictor_corrector import (
    solve_with_predictor_corrector,
)
from formulations.bounds.so3_moments.relaxation import residual_values
from formulations.bounds.so3_moments.representations.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.representations.rounding import (
    exchange_error,
    gamma,
    row_error,
    wigner_error,
)
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    degree_sectors,
)
from formulations.bounds.so3_moments.representations.wigner import (
    random_rotations,
    wigner_matrices,
)
from formulations.bounds.so3_moments.rigorous_residual import bound_defect, residual_error
from nlp.errors import InputError


@pytest.mark.parametrize(
    ("joints", "degree", "dimension"), [(1, 4, 1), (7, 8, 35), (7, 12, 476)]
)
def test_number_of_invariants(joints: int, degree: int, dimension: int) -> None:
    assert invariant_dimension(joints, degree) == dimension


def test_number_of_invariants_is_that_of_independent_functions(so3: SimpleNamespace) -> None:
    """Of degree 4: the constants and power sums over pairs of joints."""
    rotations = so3.haar_rotations(1, 60, 4)
    z = rotations[..., 0] + 1j * rotations[..., 1]
    w = np.abs(np.einsum("pia,pja->pij", z, z)) ** 2
    h = np.einsum("pia,pja->pij", z.conj(), z)
    functions = [np.ones((60, 4, 4)), w, (h**2).real, np.abs(h) ** 2]
    rank = np.linalg.matrix_rank([values.sum(axis=(1, 2)) for values in functions])
    assert rank == invariant_dimension(4, 4)


@pytest.fixture(scope="module")
def low() -> list[SectorBlocks]:
    return sector_families(degree_sectors(4, range(3)), 7)


def test_a_basis_bounds_an_invariant_everywhere(
    low: list[SectorBlocks], so3: SimpleNamespace
) -> None:
    basis = invariant_basis(low, so3.haar_rotations(2, 80, 7), 35)
    inside = residual_values(so3.haar_rotations(2, 80, 7))
    bound = basis.largest_value(inside, np.zeros(80))
    largest = 5 * 49 / 3  # all columns alike
    assert largest < bound < 1e5 * largest
    wider = basis.largest_value(inside, np.full(80, 1e-3))
    assert bound < wider


def test_rounding_is_bounded_by_the_absolute_values_of_the_left_inverse() -> None:
    """R · values is 0 with |R| · |values| as large as it can be, though ‖R‖₂ is 1."""
    left_inverse = hadamard(64)[1:] / 8.0
    values = np.ones(64)
    assert np.linalg.norm(left_inverse, 2) == pytest.approx(1)
    rounding = gamma(64) * np.linalg.norm(np.abs(left_inverse) @ values)
    bound = InvariantBasis(left_inverse, 0.0, 1.0).largest_value(values, np.zeros(64))
    assert rounding < bound < 1.1 * rounding


def test_rows_of_too_large_a_degree_are_refused(
    low: list[SectorBlocks], so3: SimpleNamespace
) -> None:
    multipliers = [np.eye(size) for family in low for size in family.sizes]
    with pytest.raises(InputError, match="degree at most 3"):
        bound_defect(low, multipliers, 0.0, so3.haar_rotations(1, 5, 7), degree=6)


def test_too_small_a_space_is_no_basis(low: list[SectorBlocks], so3: SimpleNamespace) -> None:
    with pytest.raises(NoBasisError):
        invariant_basis(low, so3.haar_rotations(2, 80, 7), 36)


def test_sums_are_enclosed(so3: SimpleNamespace, plain: ModuleType) -> None:
    family = SectorBlocks(RowSector(2, 0, 1, 4), 6)
    rng = np.random.default_rng(3)
    roots = [rng.standard_normal((size, 2)) for size in family.sizes]
    where = so3.haar_rotations(4, 3, 6)
    blocks = [
        enclosed_block(family, block, root)
        for block, root in zip(family.blocks, roots, strict=True)
    ]
    sums, errors = enclosed_sums(family, blocks, where)
    other = plain.averaged_sum_of_squares(family, where, [root @ root.T for root in roots])
    assert np.all(np.abs(sums - other) < errors + 1e-10 * other)
    assert np.all(errors < 1e-8 * sums)


def test_rows_that_are_not_symmetric_are_noticed(so3: SimpleNamespace) -> None:
    family = SectorBlocks(RowSector(2, 0, 1, 4), 6)
    block = max(family.blocks, key=lambda block: block.tableaux)
    good = enclosed_block(family, block, np.eye(block.size))
    block.parts[0][2][0] *= 1.001
    assert enclosed_block(family, block, np.eye(block.size)).difference > 1e-3
    assert good.difference < 1e-10


def test_errors_of_wigner_functions_and_rows_stay_below_their_bounds() -> None:
    rotations = random_rotations(np.random.default_rng(5), 50, 1)[:, 0]
    for spin, matrix in enumerate(wigner_matrices(rotations, 6)):
        unit = matrix @ matrix.conj().swapaxes(-1, -2) - np.eye(2 * spin + 1)
        assert np.linalg.norm(unit, 2, axis=(-2, -1)).max() <= 2.1 * wigner_error(spin) + 1e-14
    rows = PermutedRows((((1, 1),) * 6, ()), (range(6), range(6, 7)), 0)
    assert 1e-15 < row_error(rows) < 1e-11
    assert 1e-15 < exchange_error(rows) < 1e-11
    swap = rows.exchange(2)
    assert np.linalg.norm(swap @ swap - np.eye(len(swap))) < 3 * exchange_error(rows)


def test_residuals_are_off_by_less_than_their_bound(so3: SimpleNamespace) -> None:
    rotations = so3.haar_rotations(6, 20, 7)
    turned = so3.haar_rotations(7, 1, 1)[0, 0] @ rotations
    difference = np.abs(residual_values(turned) - residual_values(rotations))
    assert np.all(difference < residual_error(rotations) + residual_error(turned))
    assert residual_error(rotations).max() < 1e-11


def test_refined_multipliers_satisfy_the_equations_better(
    low: list[SectorBlocks], so3: SimpleNamespace
) -> None:
    samples = so3.haar_rotations(8, 160, 7)
    blocks = [block for family in low for block in family.evaluate(samples)]
    program = moment_program(-residual_values(samples), blocks)
    rough = solve_with_predictor_corrector(program, gap=1e-3, accuracy=1e-3).multipliers
    assert rough is not None
    rng = np.random.default_rng(9)
    noisy = [x + 1e-7 * x @ np.diag(rng.standard_normal(len(x))) @ x for x in rough]
    noisy = [0.5 * (x + x.T) for x in noisy]
    fine = refined_multipliers(program, noisy)
    before = np.abs(program.dual_residual(noisy)).max()
    assert np.abs(program.dual_residual(fine)).max() < 1e-3 * before
    assert min(np.linalg.eigvalsh(x)[0] for x in fine) > -1e-12


def test_the_defect_covers_a_claim_that_is_too_large(
    low: list[SectorBlocks], so3: SimpleNamespace
) -> None:
    samples = so3.haar_rotations(10, 160, 7)
    blocks = [block for family in low for block in family.evaluate(samples)]
    program = moment_program(residual_values(samples), blocks)
    found = solve_with_predictor_corrector(program, gap=1e-4).multipliers
    assert found is not None
    multipliers = refined_multipliers(program, found)
    claimed = program.dual_value(multipliers)
    points = so3.haar_rotations(11, 60, 7)

    def defect(constant: float, scale: float) -> float:
        scaled = [scale * x for x in multipliers]
        bounds = bound_defect(low, scaled, constant, points, degree=8, spanning="low")
        assert bounds["basis_defect"] < 0.5
        return bounds["defect"]

    assert -1e-3 < claimed < 0
    assert defect(claimed, 1.0) < 1e-5
    assert defect(claimed + 0.1, 1.0) > 0.1
    # ρ ≤ 5n²/3, and the sum of squares has the same size.
    assert defect(claimed, 1.01) > 0.01 * 5 * 49 / 3
