"""Plausible mistakes in calls of the library get a sentence, no traceback from its inside."""

import inspect

import casadi as ca
import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.kinematics.read_urdf import urdf_tree, xml_root
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.paths.waypoints import ToolPath

SEVEN = lj.arm("unit-revolute", 7, 6)
ARM = lj.realise(lj.optimal_jacobian(8))
TREE = urdf_tree(xml_root(lj.urdf(ARM).encode()))
ROBOT = lj.Robot(TREE)
X = ca.SX.sym("x", 2)
EIGHT, HERE, STUCK = np.zeros(8), lj.Pose((0.4, 0, 0.5)), [lj.Locked("joint0", 0.0)]
RANGE = lj.ReducedRange("joint0", "0", 1)
MISTAKES = {
    "a name where an arm is wanted": lambda _: lj.bound("max-min", "unit-revolute"),
    "a text for a number": lambda _: lj.bound("max-min", SEVEN, "1"),
    "a huge number": lambda _: lj.solve("max-min", joints=10**400),
    "options as a list": lambda _: lj.solve("max-min", joints=7, options=[1]),
    "an executor by name": lambda _: lj.solve("max-min", joints=7, starts=1, executor="loky"),
    "probabilities for a model": lambda _: lj.solve("max-min", joints=7, failures=[0.1] * 7),
    "names for joints": lambda _: lj.Arm("abc"),
    "a number for a path": lambda _: lj.read_jacobians(3),
    "a missing store": lambda _: lj.open_store("/nobody/has/it.db"),
    "a missing atlas": lambda _: lj.read_atlas("/nobody/has/it"),
    "a place for a pose": lambda _: lj.posture(ROBOT, at=(0.4, 0.1, 0.5)),
    "a formulation for a search": lambda _: lj.posture(ROBOT, "max-min"),
    "a text for starts": lambda _: lj.posture(ROBOT, lj.Search(starts="3")),
    "a file for an arm": lambda _: lj.posture("panda.urdf"),
    "a text for a configuration": lambda _: lj.measure(ROBOT, "0,a"),
    "places for a path": lambda _: lj.path(ROBOT, [(0.4, 0, 0.5)]),
    "a number for a link": lambda arm: lj.Robot(arm.chain, 3).arm,
    "a matrix for a manipulator": lambda _: lj.urdf(np.ones((6, 7))),
    "a text for a number of joints": lambda _: lj.optimal_jacobian("8"),
    "nothing to group": lambda _: lj.group_equivalent(None),
    "a list for outputs": lambda _: lj.Problem("a", X, X[0], outputs=[X]),
    "an expression for a constraint": lambda _: lj.Problem("a", X, X[0], constraints=(X,)),
    "no function that builds": lambda _: lj.multistart(3, np.zeros((1, 2))),
    "a negative first start": lambda _: lj.multistart(list, np.zeros((1, 2)), first=-1),
    "a table of budgets": lambda _: lj.LeverRevolute(budget=np.ones(2)),
    "a class for an arm": lambda _: lj.bound("max-min", lj.Arm),
    "a table for a goal": lambda _: lj.solve("max-min", joints=7, goal=np.ones(2)),
    "a number for failures": lambda _: lj.solve("max-min", joints=7, failures=3),
    "a number for probabilities": lambda _: lj.FailureModel(0.1),
    "a text for a tolerance": lambda _: lj.measure(np.eye(2, 3), tolerance="0"),
    "one matrix to group": lambda _: lj.group_equivalent(np.array(1.0)),
    "a text for a value": lambda _: lj.Bound("0.5", "closed form"),
    "a path for a matrix": lambda _: lj.measures.locked_sets("j.csv", 1),
    "a number for the task of an arm": lambda _: lj.Robot(TREE, task=3),
    "five positions for three": lambda arm: arm.within_bounds(np.zeros(5)),
    "a number for a clearance": lambda _: lj.posture(ROBOT, clearance=0.03),
    "a text for progress": lambda _: lj.Search(progress="yes"),
    "a number for a size": lambda arm: lj.plot(arm, size=16),
    "a table for a space": lambda _: lj.realise(np.eye(2, 3), space=np.ones(2)),
    "no sampling": lambda _: lj.choose_arrangement(ARM, "kept", sampling=3),
    "a number for a name": lambda _: lj.urdf(ARM, name=3),
    "a name that no file takes": lambda _: lj.urdf(ARM, name="a\0b"),
    "a number for directions": lambda _: TaskSpace(3),
    "a table for a frame": lambda _: TaskSpace(("vx",), np.ones(2)),
    "a function for derivatives": lambda _: lj.Problem("a", X, X[0], derivatives=len),
    "a table for a dimension": lambda _: lj.solve("max-min", task_dimension=np.ones(2)),
    "a table for an arm's": lambda _: lj.solve("max-min", SEVEN, task_dimension=np.ones(2)),
    "a table for locked joints": lambda _: lj.Robot(TREE, locked=np.ones(2)).arm,
    "a ragged point": lambda _: lj.Robot(TREE, point=[[1, 2], [3]]).arm,
    "two lines for a name": lambda _: lj.measures.as_jacobian([1], "a\nb"),
    "a number for a file": lambda _: lj.plot(lj.measure(np.eye(2, 3))).save(3),
    "a text for a failure": lambda _: lj.recover(TREE, EIGHT, ["joint0"], HERE),
    "a number for a failure": lambda _: lj.recover(TREE, EIGHT, 3, HERE),
    "a number for a joint": lambda _: lj.recover(TREE, EIGHT, [lj.Locked(3, 0.0)], HERE),
    "a text for a range": lambda _: lj.recover(TREE, EIGHT, [RANGE], HERE),
    "a place for a goal": lambda _: lj.recover(TREE, EIGHT, STUCK, (0.4, 0, 0.5)),
    "a distance for links": lambda _: lj.recover(TREE, EIGHT, STUCK, HERE, clearance=0.1),
    "a number for an effort": lambda _: lj.recover(TREE, EIGHT, STUCK, HERE, search=3),
    "a number for a tip": lambda _: lj.recover(TREE, EIGHT, STUCK, HERE, tip=3),
    "a text for directions": lambda _: lj.ToolGoal(HERE, "all"),
    "a problem for a stage": lambda _: lj.Problem("a", X, X[0], first=lj.Problem("b", X, X[0])),
}


@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_sentence(mistake, made):
    with pytest.raises(lj.InputError) as caught:
        mistake(made.planar([1.0, 0.7, 0.4]))
    assert "; allowed: " in str(caught.value)
    assert "\n" not in str(caught.value)


WRONG = [None, -1, 10**30, np.nan, "", "a\nb", b"x", [1, [2]], [[1, 2], [3]], np.ones(2)]
WRONG += [np.array("x"), {}, {"a": 1}, {1}, object, len, True, (1, 2, 3), np.eye(6, 7)]


def test_methods_of_robots_refuse_in_a_sentence():
    """Every method, with every wrong value for each of its arguments, the others left out."""
    objects = [TREE, ROBOT, ROBOT.arm, TaskSpace(), lj.Pose((0.0, 0, 0)), ToolPath(np.eye(3))]
    objects += [lj.FailureModel((0.1,) * 7), lj.Search(), lj.measure(np.eye(2, 3))]
    objects.append(lj.plot(lj.measure(np.eye(2, 3))))
    calls, said = 0, []
    for thing in objects:
        own = [a for a in dir(thing) if not (a.startswith("_") or hasattr(str, a))]
        for method in filter(callable, (getattr(thing, name) for name in own)):
            taken = inspect.signature(method).parameters.values()
            needed = [p.name for p in taken if p.default is p.empty]
            for name in (p.name for p in taken):
                for value in WRONG:
                    calls += 1
                    try:
                        method(**(dict.fromkeys(needed) | {name: value}))
                    except lj.LockedJointError as error:
                        said.append(str(error))
    assert calls > 700
    assert all(sentence.isprintable() for sentence in said)


def test_rows_of_any_kind_are_rows(made):
    """Lists, arrays and generators, where tuples are kept and hashed."""
    arm = made.planar([1.0, 0.7, 0.4])
    assert lj.FailureModel((0.1,) * 3).sparing(k for k in (1,)).probabilities[1] == 0
    assert RobotArm(arm.chain, TaskSpace(["vx", "vy"])) == arm
    for kind in (list, np.array):
        pose = lj.Pose(kind([0.4, 0.1, 0.5]), kind([0, 0, 0, 1.0]), angle=0.1)
        assert hash(pose) == hash(lj.Pose((0.4, 0.1, 0.5), (0, 0, 0, 1), angle=0.1))
        np.testing.assert_array_equal(pose.rotation, np.eye(3))
