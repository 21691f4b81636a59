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

# One arm of the worst kind: isotropic, but joint 1 moves nothing (it sits at the end effector).
_IDLE_JOINT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
# Offset, so that no point of the grid is a multiple of π/4.
_GRID = 0.01 + 2 * np.pi * np.arange(360) / 360
_ODD = "odd multiples of π/4"


def three_joint_rows(seed: int = 0, starts: int = 20) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (12)–(15) and of Figs. 1 and 2."""
    jacobian, null_space = reference.PLANAR_3R, reference.PLANAR_3R_NULL_SPACE
    values = measures.singular_values(jacobian)
    yield row.compared("(12)", "singular values of planar 3R", "σ = 1, isotropic", 1, values)
    yield _configuration_row(jacobian)
    last = np.linalg.svd(jacobian)[2][-1]
    ours, paper = last * np.sign(last @ null_space), row.shown(null_space)
    note = "last right singular vector of (12); its sign is arbitrary"
    yield row.compared("(13)", "null space of (12)", paper, null_space, ours, note)
    directions = np.degrees(np.arctan2(jacobian[1], jacobian[0]))
    gaps = np.diff(np.sort(directions), append=np.min(directions) + 360)
    quantity, expected = "angles between the columns, degrees", reference.PLANAR_3R_ANGLE
    yield row.compared("after (13)", quantity, "120", expected, gaps, tolerance=1e-9)
    sigma = reference.PLANAR_3R_SIGMA
    paper = f"√(1/3) = {row.shown(sigma)}"
    sigmas = measures.locked_singular_values(jacobian)
    yield row.compared("(14)", "fσ_2 for f = 1, 2, 3", paper, sigma, sigmas)
    units = jacobian / np.linalg.norm(jacobian, axis=0)
    cosines = [
        abs(measures.weakest_direction(np.delete(jacobian, f, axis=1)) @ unit)
        for f, unit in enumerate(units.T)
    ]
    quantity = "|cosine| between the direction that suffers most and j_f"
    yield row.compared("(15)", quantity, "1", 1, cosines)
    best = max(measures.worst_case_sigma(matrix) for matrix in _best(3, 1, seed, starts))
    quantity = "best index of a planar 3R"
    note = f"max-min over all planar 3R with tr JJᵀ = 2, {starts} random starts"
    yield row.compared("Fig. 2", quantity, paper, sigma, best, note, row.SOLVER)
    first, *others = measures.locked_singular_values(_IDLE_JOINT)
    isotropic = np.ptp(measures.singular_values(_IDLE_JOINT)) <= row.ROUNDING
    idle = max(abs(s - reference.PLANAR_3R_WORST) for s in others) <= row.ROUNDING
    quantity, true = "worst index: 2σ_2 and 3σ_2", bool(isotropic and idle)
    note = f"exhibit J = [0 1 0; 0 0 1], isotropic, joint 1 idle; 1σ_2 = {row.shown(first)}"
    yield row.claim("Fig. 2", quantity, "0", row.shown(others), true, note)


def _configuration_row(jacobian: FloatArray) -> row.ReproductionRow:
    """Place the joints in the complex plane, and differentiate where the chain ends."""
    # Turning about p moves the origin, where the end effector is, by −ip.
    places = 1j * (jacobian[0] + 1j * jacobian[1])
    links = np.diff(places, append=0)

    def end(turns: FloatArray) -> complex:
        return complex(np.sum(links * np.exp(1j * np.cumsum(turns))))

    step = 1e-5
    slopes = [(end(step * unit) - end(-step * unit)) / (2 * step) for unit in np.eye(3)]
    verdict = row.equal(reference.PLANAR_3R, [np.real(slopes), np.imag(slopes)], 1e-8)
    return row.ReproductionRow(
        "Fig. 1",
        "link lengths of a planar 3R",
        "exists",
        row.shown(np.abs(links)),
        verdict,
        "the chain's end differentiated by its joint angles gives (12)",
    )


def _best(joints: int, locked: int, seed: int, starts: int) -> list[FloatArray]:
    """Max-min over all planar arms with tr JJᵀ = 2, so that σ = 1 where they are isotropic."""
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    return optima(search(partial(max_min.build, arm, locked), arm.sample, starts, seed))


def four_joint_rows(seed: int = 0, starts: int = 20) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (16) and (17), and of the claim on double failures after them."""
    wholes = [reference.planar_4r(alpha) for alpha in _GRID]
    members = [whole[:2] for whole in wholes]
    error = float(max(np.max(np.abs(v.T @ v - np.eye(4))) for v in wholes))
    note = f"{len(_GRID)} values of α"
    yield row.within("(16)", "VᵀV = I for every α", "orthogonal", error, note)
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
    yield from _double_failure_rows(seed, starts)


def _double_failure_rows(seed: int, starts: int) -> Iterator[row.ReproductionRow]:
    def worst(alpha: float) -> float:
        return measures.worst_case_sigma(reference.planar_4r(alpha)[:2], locked=2)

    where, angles, expected = (
        "after (17)",
        _maximisers(worst),
        reference.PLANAR_4R_DOUBLE_FAILURE,
    )
    same_count = len(angles) == len(expected)
    verdict = row.equal(expected, angles, 1e-6) if same_count else row.Verdict.MISMATCH
    quantity = "α optimal for double failures"
    note = "search over α in [0, 2π) for the best worst case of two failures, in units of π/4"
    ours = f"{row.shown(angles / (np.pi / 4))}, times π/4"
    yield row.ReproductionRow(where, quantity, _ODD, ours, verdict, note)
    at_best, at_zero = worst(float(expected[0])), worst(0.0)
    answers = _best(4, 2, seed, starts)
    attained = max(measures.worst_case_sigma(matrix, 2) for matrix in answers)
    quantity = "worst case of two failures at α = kπ/4, k odd"
    note = (
        "sin(π/8) at α = π/4; the best of max-min with two locked joints over all planar 4R "
        f"with tr JJᵀ = 2, {starts} starts, is {row.shown(attained)}"
    )
    verdict = row.equal(at_best, attained, row.SOLVER)
    yield row.ReproductionRow(where, quantity, "optimal", row.shown(at_best), verdict, note)
    best = [a for a in answers if measures.worst_case_sigma(a, 2) >= attained - row.SOLVER]
    same = len(group_equivalent([reference.planar_4r(np.pi / 4)[:2], *best])) == 1
    quantity = "optimum for two failures, found over all planar 4R by max-min"
    ours = f"(16) at α = π/4 from {len(best)} of {starts} starts" if same else "another J"
    note = "canonical forms agree modulo frame, order and signs"
    yield row.claim(where, quantity, _ODD, ours, same, note)
    true = at_zero <= row.ROUNDING < at_best
    ours = row.shown(at_zero if at_zero > row.ROUNDING else 0.0)
    quantity = "worst case of two failures at α = 0"
    note = "single failures do not tell α = 0 from the optimum, double failures do"
    yield row.claim(where, quantity, "not optimal", ours, true, note)


def _maximisers(objective: Callable[[float], float]) -> FloatArray:
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
    return np.sort(
        np.mod([alpha for alpha in refined if objective(alpha) >= best - 1e-6], 2 * np.pi)
    )
