"""Entries as quadratic programs: the right optimum, and the same numbers in every format."""

import ast
import re

import casadi as ca
import numpy as np
import pytest

from lockedjoint.formulations.atlas.collection import atlas
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.measures import locked_sets
from results.optimisers.formats import as_jump, as_nl, as_sif
from results.optimisers.quadratic_program import quadratic_program
from results.optimisers.write_problem import main

NAMES = ["free-mean_2x5_k2", "unit-revolute_6x7_k1", "unit-revolute_6x8_k2"]
NAMES += ["lever-revolute_6x8_k1", "unit-revolute-6+prismatic-1_6x7_k1"]


@pytest.fixture(params=NAMES)
def program(request):
    return quadratic_program(entry(request.param))


@pytest.fixture
def point(program):
    return np.random.default_rng(1).standard_normal(program.size)


def violation(program, x):
    off = program.values(x) - [row.level for row in program.constraints]
    limits = [row.limit for row in program.constraints]
    return max(np.max(np.where(limits, off, np.abs(off))), -np.min(x[program.not_negative]))


def test_the_start_and_the_best_known_are_feasible(program):
    page = atlas(program.name)
    parts = [page.jacobian.ravel()]
    t, m = float(page.value) ** 2, page.entry.task_dimension
    for failed in locked_sets(page.jacobian, page.entry.failures):
        rest = np.delete(page.jacobian, failed, axis=1)
        values, vectors = np.linalg.eigh(rest @ rest.T - t * np.eye(m))
        assert values[0] > -1e-12
        upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0))).T)[1]
        lower = upper.T * np.where(np.diag(upper) < 0, -1, 1)
        parts.append(lower[np.tril_indices(m)])
    best = np.concatenate([*parts, [t]])
    assert violation(program, program.start) < 1e-12
    assert violation(program, best) < 1e-12
    best[-1] += 1e-3
    assert violation(program, best) > 1e-4


def levels(program):
    return [row.level for row in program.constraints]


def test_casadi_reads_the_nl_file(program, point, tmp_path):
    (tmp_path / "a.nl").write_text(as_nl(program))
    read = ca.NlpBuilder()
    read.import_nl(str(tmp_path / "a.nl"), {})
    values = ca.Function("f", [ca.vertcat(*read.x)], [read.f, ca.vertcat(*read.g)])
    objective, left = values(point)
    assert float(objective) == -point[-1]  # it minimises
    np.testing.assert_allclose(left.full().ravel(), program.values(point), atol=1e-12)
    assert read.g_ub == levels(program)
    assert read.g_lb == [-np.inf if row.limit else row.level for row in program.constraints]
    assert read.x_init == program.start.tolist()
    assert read.x_lb == np.where(program.not_negative, 0.0, -np.inf).tolist()


def test_the_sif_file_says_the_same(program, point):
    """By a reader that takes fields from their columns, as the standard has them."""
    x = {f"X{i}": value for i, value in enumerate(point)}
    left, elements, right, kinds, section = {}, {}, {}, {}, ""
    for line in as_sif(program).partition("ENDATA")[0].splitlines():
        if not line.startswith(" "):
            section = line[:14].strip()
            continue
        kind, one, two = line[1:3].strip(), line[4:14].strip(), line[14:24].strip()
        number, last = line[24:36].strip(), line[39:49].strip()
        if section == "GROUPS":
            kinds[one] = kind
            left[one] = left.get(one, 0) + (float(number) * x[two] if two else 0)
        elif section == "CONSTANTS":
            right[two] = float(number)
        elif section == "ELEMENT USES":
            elements.setdefault(one, []).append(two if kind == "T" else x[last])
        elif section == "GROUP USES":
            name, *factors = elements[two]
            assert len(factors) == {"SQ": 1, "2PR": 2}[name]
            left[one] += float(number) * factors[0] * factors[-1]
    assert left.pop("OBJ") == -point[-1]
    assert kinds.pop("OBJ") == "N"
    np.testing.assert_allclose(list(left.values()), program.values(point), atol=1e-12)
    assert [right.get(name, 0.0) for name in left] == levels(program)
    assert list(kinds.values()) == ["L" if row.limit else "E" for row in program.constraints]


def test_the_julia_file_says_the_same(program, point):
    text = as_jump(program).replace("true", "True").replace("false", "False")
    held = {k: ast.literal_eval(v) for k, v in re.findall(r"const (\w+) = (.*)", text)}
    left = np.zeros(len(program.constraints))
    for row, i, j, factor in held["PRODUCTS"]:
        left[row - 1] += factor * point[i - 1] * point[j - 1]
    for row, i, factor in held["LINEAR"]:
        left[row - 1] += factor * point[i - 1]
    np.testing.assert_allclose(left, program.values(point), atol=1e-12)
    assert held["LEVELS"] == levels(program)
    places = np.flatnonzero(program.not_negative) + 1
    assert list(held["NOT_NEGATIVE"]) == places.tolist()


def test_jax_has_the_same_values_and_a_derivative(program, point):
    jax = pytest.importorskip("jax")
    with jax.enable_x64(True):
        values = jax.jit(program.jax_values())
        np.testing.assert_allclose(values(point), program.values(point), atol=1e-12)
        slope = jax.jvp(values, (point,), (point,))[1]
        step = 1e-6 * point
        near = (program.values(point + step) - program.values(point - step)) / 2e-6
        np.testing.assert_allclose(slope, near, atol=1e-6)


def test_the_script_writes_what_the_ending_asks_for(tmp_path, capsys):
    for ending, write in (("nl", as_nl), ("sif", as_sif), ("jl", as_jump)):
        path = tmp_path / f"a.{ending}"
        assert main([NAMES[0], str(path)]) == 0
        assert path.read_text() == write(quadratic_program(entry(NAMES[0])))
    square = float(atlas(NAMES[0]).value) ** 2
    assert f"best t known: {square:.10g}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "file", "said"),
    [
        ("nothing", "b.nl", "entry"),
        ("free-mean_2x3_k1", "b.mps", "FILE"),
        ("free-mean_2x3_k1_manipulability", "b.nl", "max-min"),
    ],
)
def test_other_entries_and_endings_are_refused(name, file, said, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main([name, str(tmp_path / file)])
    assert ended.value.code == 2
    assert said in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]
