import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments import conditions
from lockedjoint.formulations.bounds.moments.plain_rows import PlainRows
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.tableaux import (
    adapted_bases,
    tableau_bases,
    young_form,
)
from tests.formulations.bounds.moments import made_rotations as so3
from tests.formulations.bounds.moments import plain_average as plain

SECTORS = [(0, 0, 0, 4), (2, 2, 1, 4), (2, 0, 2, 4), (4, 4, 1, 4), (3, 1, 1, 3), (6, 2, 0, 6)]
LOCKED = [(0, 0, 0, 4, 0), (2, 0, 1, 4, 0), (1, 2, 1, 4, 1), (2, 1, 2, 3, 1)]
UNSIGNED = [
    ((None, 2, 1, 2, 0), conditions.gram_form(0.3)),
    ((None, 1, 2, 3, 0), conditions.gram_form(0.3)),
    ((None, 1, 1, 3, 0), conditions.deviation_form(0.1)),
    ((None, 1, 1, 3), conditions.nearness(9.0)),
    ((None, 0, 1, 2), conditions.residual_distance("unsigned_scaled", 0.1, 8.0)),
]
FAMILIES = [(sector, None) for sector in [*SECTORS, (None, 1, 1, 3)]]
FAMILIES += [(sector, conditions.krylov_form(0.3)) for sector in LOCKED]
FAMILIES += [*UNSIGNED, ((1, 1, 1, 3), conditions.spectral_distance(0.2))]
# The same in a second way.
PLAIN = {"krylov": plain.krylov(0.3), "gram": plain.gram(0.3), "near": plain.near(9.0)}
PLAIN |= {"deviation": plain.deviation(0.1), "spectral": plain.spectral(0.2)}
PLAIN |= {"unsigned_scaled": plain.scaled(0.1, 8.0)}


@pytest.mark.parametrize(("sector", "condition"), FAMILIES)
def test_blocks_do_not_change_under_any_symmetry(sector, condition):
    """Where the signs of the columns are fixed, but for the sign of one column."""
    built = BlockFamily(RowSector(*sector), 7, condition)
    here = so3.haar_rotations(1, 1, 7)
    there = so3.moved(here[0], 2, signs=built.sector.odd is not None)[None]
    assert np.abs(here - there).max() > 0.1
    for a, b in zip(built.evaluate(here), built.evaluate(there), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-11)


@pytest.mark.parametrize(("sector", "condition"), [FAMILIES[k] for k in (2, 4, *range(6, 17))])
def test_the_plain_average_is_the_same_sum(sector, condition):
    joints = 7 if condition and condition.name == "gram" else 5
    built = BlockFamily(RowSector(*sector), joints, condition)
    rng = np.random.default_rng(4)
    roots = [rng.standard_normal((size, size)) for size in built.sizes]
    multipliers = [root @ root.T for root in roots]
    where = so3.haar_rotations(5, 2, joints)
    pairs = zip(multipliers, built.evaluate(where), strict=True)
    short = sum(np.tensordot(block, x, axes=2) for x, block in pairs)
    form = PLAIN[condition.name] if condition else None
    found = plain.plain_condition_sum(built, where, multipliers, form)
    np.testing.assert_allclose(found, short, rtol=1e-9)


@pytest.mark.parametrize("sector", SECTORS)
def test_rows_are_orthonormal_over_all_configurations(sector):
    family = BlockFamily(RowSector(*sector), 7)
    for block in family.evaluate(so3.haar_rotations(3, 1200, 7)):
        np.testing.assert_allclose(block.mean(axis=0), np.eye(block.shape[1]), atol=0.24)


def test_bases_follow_youngs_orthogonal_form():
    rows = BlockFamily(RowSector(4, 2, 1, 6), 6).rows
    entry = max(rows, key=lambda rows: rows.length)
    groups = (range(4), range(4, 6))
    exchanges = entry.exchanges
    for shapes, first in adapted_bases(exchanges, groups, entry.length).items():
        bases = tableau_bases(first, exchanges, groups, shapes)
        for joint, images in young_form(shapes, groups).items():
            for basis, (goal, distance) in zip(bases, images, strict=True):
                expected = basis / distance
                if abs(distance) > 1:
                    expected = expected + np.sqrt(1 - 1 / distance**2) * bases[goal]
                np.testing.assert_allclose(exchanges[joint] @ basis, expected, atol=1e-9)


def test_without_exchanges_every_row_belongs_to_the_only_shape():
    """Three labels, each on a joint of its own group, couple to spin 1 in several ways."""
    rows = PlainRows((((1, 0),), ((1, 1),), ((1, 0),)), (range(1), range(1, 2), range(2, 3)), 1)
    assert rows.length > 1
    [(shapes, basis)] = adapted_bases(rows.exchanges, rows.groups, rows.length).items()
    assert shapes == ((1,), (1,), (1,))
    np.testing.assert_allclose(basis @ basis.T, np.eye(rows.length))
