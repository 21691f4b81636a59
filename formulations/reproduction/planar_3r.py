"""Section 3, planar 3R: eqs. (12)–(15), Fig. 1 and the extremes of Fig. 2."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations import max_min, measures
from formulations.joints.arm import Arm
from formulations.joints.kinds import FreeColumn
from formulations.reproduction import reference
from formulations.reproduction.row import Row, shown
from formulations.reproduction.searches import jacobians, search
from formulations.reproduction.verdicts import equal, holds
from nlp.arrays import FloatArray

# Ipopt's own tolerance is 1e-8 on log t.
_SOLVER = 1e-7
_ROUNDING = 1e-12
# One arm of the worst kind: isotropic, but joint 1 moves nothing (it sits at the end effector).
IDLE_JOINT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def rows(
    seed: int = 0,
    starts: int = 20,
    jacobian: FloatArray = reference.PLANAR_3R,
    null_space: FloatArray = reference.PLANAR_3R_NULL_SPACE,
) -> Iterator[Row]:
    """Rows of eqs. (12)–(15) and of Figs. 1 and 2."""
    values = measures.singular_values(jacobian)
    verdict = equal(1, values, _ROUNDING)
    yield Row(
        "(12)", "singular values of planar 3R", "σ = 1, isotropic", shown(values), verdict
    )
    yield _configuration_row(jacobian)
    yield _null_space_row(jacobian, null_space)
    yield _angle_row(jacobian)
    sigmas = measures.locked_singular_values(jacobian)
    verdict = equal(reference.PLANAR_3R_SIGMA, sigmas, _ROUNDING)
    paper = f"√(1/3) = {shown(reference.PLANAR_3R_SIGMA)}"
    yield Row("(14)", "fσ_2 for f = 1, 2, 3", paper, shown(sigmas), verdict)
    yield _direction_row(jacobian)
    yield _best_row(seed, starts)
    yield _worst_row()


def end_effector(links: FloatArray, turns: FloatArray) -> FloatArray:
    """Position at the end of a planar chain of links, each joint turned by an angle.

    `links` are the link vectors before turning, shape (2, n); `turns` in radians, shape (n,).
    """
    angles = np.cumsum(turns)
    x, y = links
    turned = [x * np.cos(angles) - y * np.sin(angles), x * np.sin(angles) + y * np.cos(angles)]
    return np.asarray(np.sum(turned, axis=1))


def _configuration_row(jacobian: FloatArray) -> Row:
    """Place the joints, and differentiate where the chain ends."""
    # Turning about p moves the origin, where the end effector is, by (p_y, −p_x).
    places = np.array([-jacobian[1], jacobian[0]])
    links = np.diff(places, axis=1, append=np.zeros((2, 1)))
    step = 1e-5
    moves = [step * unit for unit in np.eye(jacobian.shape[1])]
    slopes = [
        (end_effector(links, move) - end_effector(links, -move)) / (2 * step) for move in moves
    ]
    verdict = equal(reference.PLANAR_3R, np.transpose(slopes), 1e-8)
    lengths = shown(np.linalg.norm(links, axis=0))
    note = "the chain's end differentiated by its joint angles gives (12)"
    return Row("Fig. 1", "link lengths of a planar 3R", "exists", lengths, verdict, note)


def _null_space_row(jacobian: FloatArray, null_space: FloatArray) -> Row:
    found = np.linalg.svd(jacobian)[2][-1]
    found = found * np.sign(found @ null_space)
    verdict = equal(null_space, found, _ROUNDING)
    note = "last right singular vector of (12); its sign is arbitrary"
    return Row("(13)", "null space of (12)", shown(null_space), shown(found), verdict, note)


def _angle_row(jacobian: FloatArray) -> Row:
    directions = np.degrees(np.arctan2(jacobian[1], jacobian[0]))
    gaps = np.diff(np.sort(directions), append=np.min(directions) + 360)
    verdict = equal(reference.PLANAR_3R_ANGLE, gaps, 1e-9)
    return Row("after (13)", "angles between the columns, degrees", "120", shown(gaps), verdict)


def _direction_row(jacobian: FloatArray) -> Row:
    cosines = []
    for f in range(jacobian.shape[1]):
        weakest = np.linalg.svd(np.delete(jacobian, f, axis=1))[0][:, -1]
        cosines.append(abs(weakest @ jacobian[:, f]) / np.linalg.norm(jacobian[:, f]))
    quantity = "|cosine| between the direction that suffers most and j_f"
    return Row("(15)", quantity, "1", shown(cosines), equal(1, cosines, _ROUNDING))


def _best_row(seed: int, starts: int) -> Row:
    columns = FreeColumn(2, norm=np.sqrt(2 / 3), budget="mean")  # tr JJᵀ = 2: σ = 1
    arm = Arm.of(columns, 3)
    found = search(
        lambda: max_min.build(arm),
        arm.sample,
        starts=starts,
        seed=seed,
        options=max_min.OPTIONS,
    )
    best = max(measures.worst_case_sigma(matrix) for matrix in jacobians(found))
    paper = f"√(1/3) = {shown(reference.PLANAR_3R_SIGMA)}"
    verdict = equal(reference.PLANAR_3R_SIGMA, best, _SOLVER)
    note = f"max-min over all planar 3R with tr JJᵀ = 2, {starts} random starts"
    return Row("Fig. 2", "best index of a planar 3R", paper, shown(best), verdict, note)


def _worst_row() -> Row:
    first, *others = measures.locked_singular_values(IDLE_JOINT)
    isotropic = np.ptp(measures.singular_values(IDLE_JOINT)) <= _ROUNDING
    verdict = holds(
        bool(isotropic and max(abs(s - reference.PLANAR_3R_WORST) for s in others) <= _ROUNDING)
    )
    note = f"exhibit J = [0 1 0; 0 0 1], isotropic, joint 1 idle; 1σ_2 = {shown(first)}"
    return Row("Fig. 2", "worst index: 2σ_2 and 3σ_2", "0", shown(others), verdict, note)
