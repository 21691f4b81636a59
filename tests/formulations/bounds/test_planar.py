"""Branch and bound in the plane: its multipliers, its nodes, and what it proves."""

import json
from importlib.resources import files

import cvxpy as cp
import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.bounds.certified import largest_worst_case, sharpest_worst_case_of
from lockedjoint.formulations.bounds.planar import planar_bound
from lockedjoint.formulations.bounds.planar_cells import ARCS, TURN, first_cells, is_crowded
from lockedjoint.formulations.bounds.planar_conditions import Claim, Multipliers
from lockedjoint.formulations.bounds.planar_node import Node
from lockedjoint.formulations.joints.models import arm

RECORD = json.loads(
    (files("lockedjoint.formulations.bounds") / "planar.json").read_text("utf-8")
)


def two_left(n):
    """The best worst case of n unit columns in the plane of which two are left."""
    return np.sqrt(1 - np.cos(np.pi / n))


def nearest(n):
    """The best ratio of singular values of n lines in the plane of which two are left."""
    return np.tan(np.pi / (2 * n))


@pytest.mark.parametrize(
    ("n", "failures", "above", "below", "measure"),
    [
        # Two columns are left: what the theorem says, of both measures.
        *((n, n - 2, 1.005 * two_left(n), 0.999 * two_left(n), "max-min") for n in (4, 5)),
        (4, 2, 1.005 * np.sin(np.pi / 4) / 2, 0.999 * np.sin(np.pi / 4) / 2, "manipulability"),
        *((n, n - 2, 1.005 * nearest(n), 0.999 * nearest(n), "condition") for n in (4, 5)),
        # The mean over failures is met by one failure.
        (4, 1, 1.02, 0.98, "max-min"),
    ],
)
def test_levels_above_what_is_attained_are_proved_and_none_below(
    n, failures, above, below, measure
):
    assert planar_bound(n, failures, above, measure).proved
    other = planar_bound(n, failures, below, measure, most_nodes=150)
    assert (other.proved, other.to_dict()["kind"]) == (False, "undecided")


def located(jacobian, arcs):
    """Return the cells of a turn in `arcs` parts that the doubled angles are in, one pinned."""
    angles = np.angle((jacobian[0] + 1j * jacobian[1]) ** 2) % (2 * np.pi)
    first = 2 * np.pi / ARCS
    held = [np.sum((angles - start) % (2 * np.pi) < first) for start in angles]
    pinned = int(np.argmax(held))
    rest = np.delete((angles - angles[pinned]) % (2 * np.pi), pinned)
    counts = np.bincount((rest * arcs / (2 * np.pi)).astype(int), minlength=arcs)
    size = TURN // arcs
    cells = [(i * size, (i + 1) * size, int(one)) for i, one in enumerate(counts) if one]
    return pinned, ((0, 0, 1), *cells)


@pytest.mark.parametrize("seed", range(5))
def test_every_jacobian_is_in_a_node(seed):
    jacobian = np.random.default_rng(seed).normal(size=(2, 6))
    assert located(jacobian, ARCS)[1] in set(first_cells(6))
    for arcs in (16, 64):
        assert not is_crowded(located(jacobian, arcs)[1])


@pytest.mark.parametrize("measure", ["max-min", "manipulability", "condition"])
@pytest.mark.parametrize("seed", range(8))
def test_any_multipliers_bound_every_jacobian_of_the_node(seed, measure):
    rng = np.random.default_rng(seed)
    jacobian, k = rng.normal(size=(2, 6)), 2
    if measure == "manipulability":  # the measure is that of isotropic ones
        jacobian = np.linalg.solve(np.linalg.cholesky(jacobian @ jacobian.T), jacobian)
        value = measures.relative_manipulability(jacobian, k).min()
    elif measure == "condition":  # at the level that it attains no node is excluded
        value = 0.0
    else:
        value = 2 * measures.worst_case_sigma(jacobian, k) ** 2 / measures.trace(jacobian)
    _, cells = located(jacobian, ARCS)
    level = measures.reciprocal_conditions(jacobian, k).min()
    node = Node(cells, Claim.of(measure, 6, k, level))
    counts = np.array([one[2] for one in cells])
    mass = rng.random(counts.size)
    conditions = node._tightest(mass, mass * np.exp(1j * (node._low + node._high) / 2))
    assert conditions.shares @ counts == pytest.approx(np.full(len(conditions.points), 4))
    nu = complex(*rng.normal(size=2)) if measure == "manipulability" else 0j
    some = Multipliers(conditions, rng.random(len(conditions.points)), nu)
    assert value <= some.proved(node._low, node._high) + 1e-12
    # So do those of the linear program, which are to be sharp.
    found = node._program(np.exp(1j * np.stack([node._low, node._high], axis=1)), conditions)[2]
    assert value <= found.proved(node._low, node._high) + 1e-12


@pytest.mark.parametrize(("n", "k"), [(5, 2), (6, 3)])
def test_the_best_known_stays_in_one_node(n, k):
    """Where the level is below it, one of the parts has it, however small."""
    page = page_of(Entry("free-mean", 2, n, k))
    claim = Claim.of("max-min", n, k, 0.9995 * float(page.value))
    pinned, cells = located(page.jacobian, ARCS)
    angles = np.angle((page.jacobian[0] + 1j * page.jacobian[1]) ** 2)
    rest = np.delete((angles - angles[pinned]) % (2 * np.pi), pinned) * TURN / (2 * np.pi)

    def holds(part):
        cells = [cell for cell in part._cells if cell[1] > cell[0]]
        return all(count == np.sum((low <= rest) & (rest < high)) for low, high, count in cells)

    node = Node(cells, claim)
    for _ in range(12):
        [node] = filter(holds, node.parts())


@pytest.mark.parametrize("one", RECORD, ids=lambda one: one["command"][-40:])
def test_the_record_is_just_above_the_best_that_is_known(one):
    best = float(
        page_of(Entry("free-mean", 2, one["joints"], one["failures"], one["measure"])).value
    )
    assert one["proved"]
    assert best < one["level"] < 1.05 * best


def test_the_record_is_what_the_search_proves():
    [same] = [one for one in RECORD if (one["joints"], one["failures"]) == (6, 3)][:1]
    found = planar_bound(6, 3, same["level"], same["measure"])
    assert found.to_dict() | {"nodes": 0} == same | {"nodes": 0}


def test_all_that_give_bounds_give_the_same():
    entry = Entry("free-mean", 2, 7, 3)
    page = page_of(entry)
    free = largest_worst_case(arm("free-mean", 7, 2), 3)
    assert entry.bound == free
    assert free.kind == "proved (branch and bound)"
    scaled = sharpest_worst_case_of(3 * page.jacobian, 3)
    # Nothing is left of the zero matrix, nor of m + k − 1 columns.
    nothing = np.zeros((2, 5)), np.random.default_rng(0).normal(size=(6, 7))
    assert [sharpest_worst_case_of(one, 2).value for one in nothing] == [0.0, 0.0]
    assert (scaled.value, scaled.kind) == (pytest.approx(3 * free.value), free.kind)


def node_program(corners, conditions, measure):
    """The program of a node in cvxpy: masses at the corners of its cells, the least share s."""
    masses, s = cp.Variable(corners.shape, nonneg=True), cp.Variable()
    left = conditions.left_at(corners)
    shares = cp.hstack([cp.sum(cp.multiply(one, masses)) for one in left])
    stated = [cp.sum(masses) == 1, shares >= cp.multiply(conditions.weights, s)]
    if measure == "manipulability":
        stated += [
            cp.sum(cp.multiply(part, masses)) == 0 for part in (corners.real, corners.imag)
        ]
    return cp.Problem(cp.Maximize(s), stated)


@pytest.mark.parametrize("measure", ["max-min", "manipulability", "condition"])
@pytest.mark.parametrize("number", range(0, 40, 7))
def test_the_program_of_a_node_is_that_of_cvxpy(measure, number):
    cells = list(first_cells(6))
    claim = Claim.of(measure, 6, 2, 0.4)
    node = Node(cells[number % len(cells)], claim)
    middle = 0.5 * (node._low + node._high)
    corners = np.exp(1j * np.stack([node._low, middle, node._high], axis=1))
    even = np.full_like(node._counts, 1 / node._counts.sum())
    conditions = node._tightest(even, even * corners[:, 1])
    _, value, multipliers = node._program(corners, conditions)
    stated = node_program(corners, conditions, measure)
    stated.solve(solver="CLARABEL")
    if multipliers is None:
        assert stated.status.startswith("infeasible")
    else:
        assert value == pytest.approx(stated.value, abs=1e-7)


def test_progress_says_which_share_of_the_search_is_done():
    told = []
    assert planar_bound(5, 2, 0.50937590797, "manipulability", progress=told.append).proved
    shares = [step.share for step in told]
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.5 < shares[-1] <= 1.0
