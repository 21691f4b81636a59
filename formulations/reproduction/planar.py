"""Section 3, planar arms: 3R with eqs. (12)–(15) and Figs. 1 and 2, 4R with (16) and (17)."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from formulations import max_min, measures
from formulations.joints.arm import Arm
from formulations.joints.kinds import FreeColumn
from formulations.measures.canonical import group_equivalent
from formulations.reproduction import reference, row
from formulations.reproduction.searches import optima, search
from nlp.arrays import FloatArray

Family = Callable[[float], FloatArray]
# One arm of the worst kind: isotropic, but joint 1 moves nothing (it sits at the end effector).
IDLE_JOINT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
# Offset, so that no point of the grid is a multiple of π/4.
_GRID = 0.01 + 2 * np.pi * np.arange(360) / 360
_ODD = "odd multiples of π/4"


def rows(seed: int = 0, starts: int = 20) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (12)–(17) and of Figs. 1 and 2."""
    yield from three_joint_rows(seed, starts)
    yield from four_joint_rows(seed, starts)


def three_joint_rows(
    seed: int = 0,
    starts: int = 20,
    jacobian: FloatArray = reference.PLANAR_3R,
    null_space: FloatArray = reference.PLANAR_3R_NULL_SPACE,
) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (12)–(15) and of Figs. 1 and 2."""
    values = measures.singular_values(jacobian)
    yield row.compared("(12)", "singular values of planar 3R", "σ = 1, isotropic", 1, values)
    yield _configuration_row(jacobian)
    found = np.linalg.svd(jacobian)[2][-1]
    found = found * np.sign(found @ null_space)
    note = "last right singular vector of (12); its sign is arbitrary"
    yield row.compared(
        "(13)", "null space of (12)", row.shown(null_space), null_space, found, note
    )
    directions = np.degrees(np.arctan2(jacobian[1], jacobian[0]))
    gaps = np.diff(np.sort(directions), append=np.min(directions) + 360)
    quantity, expected = "angles between the columns, degrees", reference.PLANAR_3R_ANGLE
    yield row.compared("after (13)", quantity, "120", expected, gaps, tolerance=1e-9)
    sigma = reference.PLANAR_3R_SIGMA
    paper = f"√(1/3) = {row.shown(sigma)}"
    sigmas = measures.locked_singular_values(jacobian)
    yield row.compared("(14)", "fσ_2 for f = 1, 2, 3", paper, sigma, sigmas)
    quantity = "|cosine| between the direction that suffers most and j_f"
    yield row.compared("(15)", quantity, "1", 1, _cosines(jacobian))
    best = max(measures.worst_case_sigma(matrix) for matrix in _best(3, 1, seed, starts))
    note = f"max-min over all planar 3R with tr JJᵀ = 2, {starts} random starts"
    yield row.compared(
        "Fig. 2", "best index of a planar 3R", paper, sigma, best, note, row.SOLVER
    )
    yield _worst_row()


def end_effector(links: FloatArray, turns: FloatArray) -> FloatArray:
    """Position at the end of a planar chain of links, each joint turned by an angle.

    `links` are the link vectors before turning, shape (2, n); `turns` in radians, shape (n,).
    """
    angles = np.cumsum(turns)
    x, y = links
    turned = [x * np.cos(angles) - y * np.sin(angles), x * np.sin(angles) + y * np.cos(angles)]
    return np.asarray(np.sum(turned, axis=1))


def _configuration_row(jacobian: FloatArray) -> row.ReproductionRow:
    """Place the joints, and differentiate where the chain ends."""
    # Turning about p moves the origin, where the end effector is, by (p_y, −p_x).
    places = np.array([-jacobian[1], jacobian[0]])
    links = np.diff(places, axis=1, append=np.zeros((2, 1)))
    step = 1e-5
    moves = [step * unit for unit in np.eye(jacobian.shape[1])]
    slopes = [
        (end_effector(links, move) - end_effector(links, -move)) / (2 * step) for move in moves
    ]
    verdict = row.equal(reference.PLANAR_3R, np.transpose(slopes), 1e-8)
    lengths = row.shown(np.linalg.norm(links, axis=0))
    note = "the chain's end differentiated by its joint angles gives (12)"
    return row.ReproductionRow(
        "Fig. 1", "link lengths of a planar 3R", "exists", lengths, verdict, note
    )


def _cosines(jacobian: FloatArray) -> list[float]:
    cosines = []
    for f in range(jacobian.shape[1]):
        weakest = measures.weakest_direction(np.delete(jacobian, f, axis=1))
        cosines.append(float(abs(weakest @ jacobian[:, f]) / np.linalg.norm(jacobian[:, f])))
    return cosines


def _worst_row() -> row.ReproductionRow:
    first, *others = measures.locked_singular_values(IDLE_JOINT)
    isotropic = np.ptp(measures.singular_values(IDLE_JOINT)) <= row.ROUNDING
    idle = max(abs(s - reference.PLANAR_3R_WORST) for s in others) <= row.ROUNDING
    note = f"exhibit J = [0 1 0; 0 0 1], isotropic, joint 1 idle; 1σ_2 = {row.shown(first)}"
    quantity, true = "worst index: 2σ_2 and 3σ_2", bool(isotropic and idle)
    return row.claim("Fig. 2", quantity, "0", row.shown(others), true, note)


def _best(joints: int, locked: int, seed: int, starts: int) -> list[FloatArray]:
    """Max-min over all planar arms with tr JJᵀ = 2, so that σ = 1 where they are isotropic."""
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    build = partial(max_min.build, arm, locked)
    return optima(search(build, arm.sample, starts, seed))


def four_joint_rows(
    seed: int = 0, starts: int = 20, family: Family = reference.planar_4r
) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (16) and (17), and of the claim on double failures after them."""
    wholes = [family(alpha) for alpha in _GRID]
    members = [whole[:2] for whole in wholes]
    error = float(max(np.max(np.abs(v.T @ v - np.eye(4))) for v in wholes))
    quantity, note = "VᵀV = I for every α", f"{len(_GRID)} values of α"
    yield row.within("(16)", quantity, "orthogonal", error, note)
    classes = len(group_equivalent(members[:45], tolerance=1e-3))
    quantity = "distinct Jacobians among 45 values of α"
    note = (
        "modulo frame, order and signs; α over one eighth of a turn, beyond which they repeat"
    )
    yield row.claim("(16)", quantity, "a family", classes, classes == 45, note)
    sigma = reference.PLANAR_4R_SIGMA
    sigmas = np.concatenate([measures.locked_singular_values(matrix) for matrix in members])
    quantity, paper = "fσ_2 for all f and α", f"√(1/2) = {row.shown(sigma)}"
    note = "the value farthest from the paper's"
    yield row.compared("(17)", quantity, paper, sigma, sigmas, note, show=row.farthest(sigma))
    yield from _double_failure_rows(seed, starts, family)


def _double_failure_rows(
    seed: int, starts: int, family: Family
) -> Iterator[row.ReproductionRow]:
    def worst(alpha: float) -> float:
        return measures.worst_case_sigma(family(alpha)[:2], locked=2)

    found = _best_parameters(worst)
    expected = reference.PLANAR_4R_DOUBLE_FAILURE
    verdict = (
        row.equal(expected, found, 1e-6) if len(found) == len(expected) else row.holds(False)
    )
    note = "search over α in [0, 2π) for the best worst case of two failures, in units of π/4"
    ours = f"{row.shown(found / (np.pi / 4))}, times π/4"
    yield row.ReproductionRow(
        "after (17)", "α optimal for double failures", _ODD, ours, verdict, note
    )
    at_best, at_zero = worst(float(expected[0])), worst(0.0)
    answers = _best(4, 2, seed, starts)
    attained = max(measures.worst_case_sigma(matrix, 2) for matrix in answers)
    note = (
        "sin(π/8) at α = π/4; the best of max-min with two locked joints over all planar 4R "
        f"with tr JJᵀ = 2, {starts} starts, is {row.shown(attained)}"
    )
    quantity = "worst case of two failures at α = kπ/4, k odd"
    verdict = row.equal(at_best, attained, row.SOLVER)
    yield row.ReproductionRow(
        "after (17)", quantity, "optimal", row.shown(at_best), verdict, note
    )
    best = [a for a in answers if measures.worst_case_sigma(a, 2) >= attained - row.SOLVER]
    same = len(group_equivalent([family(np.pi / 4)[:2], *best])) == 1
    quantity = "optimum for two failures, found over all planar 4R by max-min"
    ours = f"(16) at α = π/4 from {len(best)} of {starts} starts" if same else "another J"
    note = "canonical forms agree modulo frame, order and signs"
    yield row.claim("after (17)", quantity, _ODD, ours, same, note)
    quantity = "worst case of two failures at α = 0"
    ours = row.shown(at_zero if at_zero > row.ROUNDING else 0.0)
    note = "single failures do not tell α = 0 from the optimum, double failures do"
    yield row.claim(
        "after (17)", quantity, "not optimal", ours, at_zero <= row.ROUNDING < at_best, note
    )


def _best_parameters(objective: Callable[[float], float]) -> FloatArray:
    """Return all α in [0, 2π) that maximise a periodic function, ascending.

    None where the function has no peaks.
    """
    values = np.array([objective(alpha) for alpha in _GRID])
    peaks = (values >= np.roll(values, 1)) & (values > np.roll(values, -1))
    step = 2 * np.pi / len(_GRID)
    refined = [
        minimize_scalar(
            lambda alpha: -objective(alpha),
            bounds=(peak - step, peak + step),
            method="bounded",
            options={"xatol": 1e-10},
        ).x
        for peak in _GRID[peaks]
    ]
    best = max((objective(alpha) for alpha in refined), default=np.nan)
    kept = [alpha for alpha in refined if objective(alpha) >= best - 1e-6]
    return np.sort(np.mod(kept, 2 * np.pi))
