"""The bounds of `distance_bounds`: against more digits, a second implementation and draws."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from formulations.kinematics.chain import Motion, frozen
from formulations.kinematics.forward import Kinematics
from formulations.kinematics.link_chain import homogeneous
from formulations.recovery.goal import ToolGoal
from formulations.recovery.unreachable import upright_motions
from formulations.robots.pose_constrained_arm import Pose
from formulations.workspaces.distance_bounds import distances, largest_number


@pytest.fixture(params=["revolute", "prismatic"])
def case(request, made):
    """A chain along z, whose second motion is of a kind, and boxes of all widths."""
    chain, rng = made.chain(made.offset_arm(6)), np.random.default_rng(2)
    columns = upright_motions(chain, ToolGoal(Pose((0.5, 9.0, 0.1))))
    places = [np.array([*place, [0, 0, 0, 1]]) for place in columns["placements"]]
    slides = [k == 1 and request.param == "prismatic" for k in range(6)]
    motions = [
        Motion(frozen(place if k else np.eye(4)), (0.0, 0.0, 1.0), slides[k], k, 1.0, 0.0)
        for k, place in enumerate(places)
    ]
    end = frozen(homogeneous(np.eye(3), columns["starts"][0]))
    lower, upper = (side[:, None] for side in chain.limits)
    middle = rng.uniform(lower, upper, (6, 800))
    half = (upper - lower) * 10.0 ** rng.uniform(-4, 0, 800)
    low, high = np.maximum(middle - half, lower), np.minimum(middle + half, upper)
    return replace(chain, motions=tuple(motions), end=end), low, high


def test_rounding_is_as_little_as_it_says(case):
    chain, low, high = case
    point = {"start": [row[3] for row in chain.end[:3]], "target": [0.5, 9.0, 0.1]}
    motions = [asdict(motion) for motion in chain.motions]
    more = (side.astype(np.longdouble) for side in (low, high))
    away, exactly = (distances(motions, point, *box)[0] for box in ((low, high), tuple(more)))
    claim = {"motions": motions, "lower": chain.limits[0], "upper": chain.limits[1]}
    if np.finfo(np.longdouble).eps < 1e-18:
        size = largest_number({**claim, "points": [point]})
        assert 0 < np.abs(away - exactly).max() < 1e-16 * size


def test_no_box_is_left_out_that_reaches_its_target(case):
    chain, low, high = case
    motions, left_out = [asdict(motion) for motion in chain.motions], 0
    start = [row[3] for row in chain.end[:3]]
    for k, inside in enumerate(np.random.default_rng(3).uniform(low, high).T):
        place = Kinematics(chain).forward(inside[:, None])[0][:, 0]
        box = low[:, [k]], high[:, [k]]
        for target, reached in ((place, True), (place + np.ptp(box, 0).max() + 0.01, False)):
            point = {"start": start, "target": target.tolist()}
            away, _ = distances(motions, point, *box)
            assert away == pytest.approx(second_bound(chain, point, *box), abs=1e-12)
            assert not reached or away[0] < 1e-12
            left_out += away[0] > 0
    assert left_out > 300


def second_bound(chain, point, low, high):
    """The same bounds, from the library's kinematics and complex numbers."""
    middle, wide = (low + high) / 2, (high - low) / 2
    end = frozen(homogeneous(np.eye(3), point["start"]))
    axes, origins, tip, _ = Kinematics(replace(chain, end=end)).frames(middle)
    rates = np.cross(axes, tip - origins, axis=1)
    motions, target = chain.motions, np.array(point["target"])
    halves = [abs(motion.multiplier) * wide[motion.variable] for motion in motions]
    there, arc = complex(*target[:2]), halves[0]
    turn = np.clip(np.angle((tip[0] + 1j * tip[1]) * np.conj(there)), -arc, arc)
    nearest = there * np.exp(1j * turn)
    direction = tip - [nearest.real, nearest.imag, np.full_like(arc, target[2])]
    direction = direction / np.linalg.norm(direction, axis=0)
    beside = (direction[0] + 1j * direction[1]) * np.conj(there)
    turned = np.maximum(np.abs(np.angle(beside)) - arc, 0.0)
    most = direction[2] * target[2] + np.abs(beside) * np.cos(turned)
    away = np.sum(direction * tip, axis=0) - most
    ball, spread, chords = np.array([point["start"]]).T, 0.0, 0.0
    for motion, half, rate, axis in reversed(
        list(zip(motions, halves, rates, axes, strict=True))[1:]
    ):
        if motion.prismatic:
            value = motion.multiplier * middle[motion.variable] + motion.offset
            ball, spread, rate = ball + np.outer([0, 0, 1], value), spread + half, axis
            largest, chord = np.ones_like(half), half
        else:
            spread = spread + np.hypot(ball[0], ball[1])
            ball = ball * np.array([[0, 0, 1]]).T
            largest = np.minimum(spread, np.linalg.norm(rate, axis=0) + chords)
            chord = 2 * largest * np.sin(np.minimum(half, np.pi) / 2)
        along = np.abs(np.sum(direction * rate, axis=0)) + chords + largest * half / 2
        away = away - np.minimum(chord, along * half)
        chords = chords + chord
        placement = np.array(motion.placement)
        ball = placement[:3, :3] @ ball + placement[:3, 3:]
    radius = np.hypot(*target[:2])
    ring = np.hypot(np.hypot(ball[0], ball[1]) - radius, ball[2] - target[2]) - spread
    return np.maximum(away, ring)
