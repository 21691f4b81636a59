"""Isotropic arms of five revolute and two prismatic joints: solutions are never excluded."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.bounds import five_levers
from lockedjoint.formulations.bounds.certified import largest_isotropic_worst_case
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute

BEST = page_of(entry("lever-revolute-5+prismatic-2_6x7_k1_isotropy"))


def unknowns_of(jacobian):
    """Return 2φ_i and r_i of an isotropic J, by the construction of the page."""
    levers, axes = jacobian[:3, :5], jacobian[3:, :5]
    null = np.linalg.svd(jacobian)[2][-1]
    first = null[:5] / np.linalg.norm(null[:5])
    rows = np.linalg.svd(np.vstack([axes, first[None]]))[2]
    second = rows[-1]
    along = levers @ first / np.linalg.norm(levers @ first)
    across = levers @ second / np.linalg.norm(levers @ second)
    cosines, sines = np.sqrt(2.5) * first, np.sqrt(2.5) * second
    # The axis has the components r sin φ and −(2/√5) r cos φ; the larger one is divided.
    by_cosine = -(across @ axes) / (2 / np.sqrt(5) * cosines)
    ratios = np.where(np.abs(sines) > 0.1, along @ axes / sines, by_cosine)
    return 2 * np.arctan2(sines, cosines), ratios


def equations(unknowns):
    angles, ratios = unknowns[:5], unknowns[5:]
    points = np.exp(1j * angles)
    sums = [points.sum(), (ratios * points).sum(), (ratios**2 * (points - 1 / 9)).sum()]
    parts = [value for one in sums for value in (one.real, one.imag)]
    return np.array([*parts, ratios.sum(), ratios @ ratios - 15 / 4])


@cache
def solutions(count):
    """Return angles of solutions from random starts, sorted, in (−π, π]."""
    rng, found = np.random.default_rng(7), []
    while len(found) < count:
        start = np.concatenate([rng.uniform(-np.pi, np.pi, 5), rng.standard_normal(5)])
        answer = least_squares(equations, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if answer.cost < 1e-22:
            angles = answer.x[:5]
            found.append(np.sort(np.angle(np.exp(1j * angles))))
    return np.array(found)


def test_the_best_known_arm_satisfies_the_equations():
    angles, ratios = unknowns_of(BEST.jacobian)
    assert np.abs(equations(np.concatenate([angles, ratios]))).max() < 1e-5
    least = (np.cos(angles / 2) ** 2).min()
    assert 2 / 15 * least == pytest.approx(float(BEST.value) ** 2, rel=1e-6)


@pytest.mark.parametrize("radius", [1e-6, 1e-3, 0.03, 0.3, 1.0])
def test_no_box_with_a_solution_is_excluded(radius):
    rng = np.random.default_rng(1)
    angles = solutions(40)
    radii = radius * rng.uniform(0.1, 1.0, angles.shape)
    middles = angles + radii * rng.uniform(-1.0, 1.0, angles.shape)
    assert not five_levers.is_excluded(middles, radii).any()


def test_boxes_away_from_solutions_are_excluded():
    rng = np.random.default_rng(2)
    middles = np.sort(rng.uniform(-2.0, 2.0, (200, 5)), axis=1)
    assert five_levers.is_excluded(middles, np.full((200, 5), 1e-4)).mean() > 0.95


def test_the_share_on_record_is_proved_and_what_is_attained_is_not(monkeypatch):
    bound = five_levers.five_levers_bound()
    assert float(BEST.value) < bound < 1.0004 * float(BEST.value)
    assert five_levers.proves_five_levers(Fraction(bound) ** 2)
    assert not five_levers.proves_five_levers(Fraction(bound * (1 - 1e-9)) ** 2)
    found = largest_isotropic_worst_case(BEST.entry.arm)
    assert (found.value, found.certified) == (bound, True)
    monkeypatch.setattr(five_levers, "_MOST", 20_000)
    assert not five_levers.excludes_share(0.2286)


@pytest.mark.parametrize(
    ("revolute", "prismatic", "holds"),
    [
        (UnitRevolute(), Prismatic(), True),
        (LeverRevolute(3.0, "mean"), Prismatic(), True),
        (LeverRevolute(1.0, "each", 0.1), Prismatic(), False),
        (UnitRevolute(), Prismatic(0.5), False),
    ],
)
def test_it_is_used_for_arms_of_which_it_is_proved(revolute, prismatic, holds):
    assert five_levers.has_five_levers(Arm((revolute,) * 5 + (prismatic,) * 2)) is holds
    assert not five_levers.has_five_levers(Arm((revolute,) * 6 + (prismatic,)))
