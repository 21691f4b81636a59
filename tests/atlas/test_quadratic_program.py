"""Entries as quadratic programs: the right optimum, and the same numbers in the file."""

import casadi as ca
import numpy as np
import pytest

from formulations.atlas.collection import atlas
from formulations.atlas.entry import entry
from formulations.atlas.quadratic_program import as_nl, quadratic_program
from formulations.measures import locked_sets

NAMES = (
    "free-mean_2x5_k2",
    "unit-revolute_6x7_k1",
    "lever-revolute_6x8_k1",
    "unit-revolute-6+prismatic-1_6x7_k1",
)


@pytest.fixture(params=NAMES)
def program(request):
    return quadratic_program(entry(request.param))


@pytest.fixture
def point(program):
    return np.random.default_rng(1).standard_normal(program.size)


def left_sides(program, x):
    return np.array(
        [
            sum(factor * x[i] * x[j] for (i, j), factor in row.products.items())
            + sum(factor * x[i] for i, factor in row.linear.items())
            for row in program.rows
        ]
    )


def levels(program):
    return [row.level for row in program.rows]


def violation(program, x):
    off = left_sides(program, x) - levels(program)
    limits = [row.limit for row in program.rows]
    return max(np.max(np.where(limits, off, np.abs(off))), -np.min(x[program.not_negative]))


def test_the_start_and_the_best_known_are_feasible(program):
    page = atlas(program.name)
    parts = [page.jacobian.ravel()]
    t, m = float(page.value) ** 2, page.entry.task_dimension
    for failed in locked_sets(page.jacobian, page.entry.locked):
        rest = np.delete(page.jacobian, failed, axis=1)
        values, vectors = np.linalg.eigh(rest @ rest.T - t * np.eye(m))
        assert values[0] > -1e-12
        upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0))).T)[1]
        lower = upper.T * np.where(np.diag(upper) < 0, -1, 1)
        parts.append(lower[np.tril_indices(m)])
    best = np.concatenate([*parts, [t]])
    assert violation(program, program.start) < 1e-12
    assert violation(program, best) < 1e-12
    assert (
        violation(program, best + 1e-3 * (np.arange(program.size) == program.size - 1)) > 1e-4
    )


def test_casadi_reads_the_nl_file(program, point, tmp_path):
    (tmp_path / "a.nl").write_text(as_nl(program))
    read = ca.NlpBuilder()
    read.import_nl(str(tmp_path / "a.nl"), {})
    values = ca.Function("f", [ca.vertcat(*read.x)], [read.f, ca.vertcat(*read.g)])
    objective, left = values(point)
    assert float(objective) == -point[-1]  # it minimises
    np.testing.assert_allclose(left.full().ravel(), left_sides(program, point), atol=1e-12)
    assert read.g_ub == levels(program)
    assert read.g_lb == [-np.inf if row.limit else row.level for row in program.rows]
    assert read.x_init == program.start.tolist()
    assert read.x_lb == np.where(program.not_negative, 0.0, -np.inf).tolist()
