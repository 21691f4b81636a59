"""Plausible mistakes in calls of the library get a sentence, no traceback from its inside."""

import numpy as np
import pytest

import lockedjoint as lj

SEVEN = lj.arm("unit-revolute", 7, 6)
MISTAKES = {
    "a name where an arm is wanted": lambda _: lj.bound("max-min", "unit-revolute"),
    "a text for a number": lambda _: lj.bound("max-min", SEVEN, "1"),
    "a huge number": lambda _: lj.solve("max-min", joints=10**400),
    "options as a list": lambda _: lj.solve("max-min", joints=7, options=[1]),
    "an executor by name": lambda _: lj.solve("max-min", joints=7, starts=1, executor="loky"),
    "probabilities for a model": lambda _: lj.solve("max-min", joints=7, failures=[0.1] * 7),
    "names for joints": lambda _: lj.Arm("abc"),
    "no joints": lambda _: lj.Arm(None),
    "a number for a path": lambda _: lj.read_jacobians(3),
    "no path": lambda _: lj.read_waypoints(None),
    "a missing store": lambda _: lj.open_store("/nobody/has/it.db"),
    "a missing atlas": lambda _: lj.read_atlas("/nobody/has/it"),
    "a place for a pose": lambda arm: lj.best_posture(arm, at=(0.4, 0.1, 0.5)),
    "a formulation for a search": lambda arm: lj.best_posture(arm, "max-min"),
    "a text for starts": lambda arm: lj.best_posture(arm, lj.Search(starts="3")),
    "a file for an arm": lambda _: lj.best_posture("panda.urdf"),
    "a text for a configuration": lambda arm: lj.measure_robot(arm, "0,0,0"),
    "places for a path": lambda arm: lj.plan_path(arm, [(0.4, 0, 0.5)]),
    "a number for a link": lambda arm: lj.RobotArm.read(arm.chain, 3),
    "a text for a place": lambda _: lj.Pose("abc"),
    "a matrix for a manipulator": lambda _: lj.urdf(np.ones((6, 7))),
    "a text for a number of joints": lambda _: lj.optimal_jacobian("8"),
    "nothing to group": lambda _: lj.group_equivalent(None),
    "no problem": lambda _: lj.Problem("a", None, None),
}


@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_sentence(mistake, made):
    with pytest.raises(lj.InputError) as caught:
        mistake(made.planar([1.0, 0.7, 0.4]))
    assert "; allowed: " in str(caught.value)
    assert "\n" not in str(caught.value)
