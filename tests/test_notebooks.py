"""What a notebook shows of a result: one line, and a table where there is one."""

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.paths.plan import PathPlan, Trajectory
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.robots.posture_search import case_of


@pytest.fixture(scope="module")
def planar(made):
    tree = made.tree(made.planar_urdf([1.0, 0.7, 0.4]))
    return lj.Robot(tree, "tip", task="vx,vy")


def test_one_line_each(planar):
    posture, arm = lj.posture(planar, starts=3), planar.arm
    robot = lj.realise(lj.optimal_jacobian(8))
    chosen = lj.choose_arrangement(robot, "total-length")
    outcome = lj.solve("max-min", "free", 3, 2, starts=2, workers=1)
    for value, words in (
        (outcome, "solved, "),
        (outcome.best, "passes the check"),
        (outcome.arm, "3 × FreeColumn"),
        (lj.bound("max-min", outcome.arm), "<Bound"),
        (lj.measure(outcome.best.jacobian), "% below the bound (6)"),
        (robot, "<Manipulator"),
        (planar, "<Robot made: 3 joints from l0 to tip, task vx,vy>"),
        (arm, "<RobotArm: 3 joints of made from l0 to tip, task vx, vy>"),
        (posture, "of 3 starts>"),
        (posture.assessment, "% of the bound (6)>"),
        (chosen, "from base to tip, by total-length"),
        (lj.read_atlas()[0], "(optimal)>"),
        (arm.chain, "<Chain: robot made, base l0, tip tip, joints (3 entries)"),
        (lj.Search(), "<Search: as by default>"),
        (lj.Search(starts=3, maximise="expected"), "<Search: maximise expected, starts 3>"),
        (lj.Pose((0, 0, 1)), "<Pose: position (0, 0, 1)>"),
        (arm.task, "<TaskSpace: directions (vx, vy), frame base>"),
        (ToolPath(np.eye(3)), "<ToolPath: positions of shape 3×3>"),
        (lj.FailureModel((0.1, 0.2)), "<FailureModel: probabilities (0.1, 0.2), failures 1>"),
        (lj.plot(posture.assessment), "<Plot: figure <Figure "),
        (lj.measures.worst_case(np.eye(2, 3)), "<WorstCase: sigma 0, joints (0)"),
        (case_of(lj.Search(), arm), "<Case: formulation max_min, arm <RobotArm: 3 joints"),
    ):
        assert words in repr(value)
        assert "\n" not in repr(value)
        assert repr(value).startswith(f"<{type(value).__name__}")
        assert len(repr(value)) < 250
        assert "<p>&lt;" in getattr(value, "_repr_html_", lambda: "<p>&lt;")()
    assert "<table" in posture._repr_html_()


def test_a_path():
    trajectory = Trajectory(np.zeros((4, 2)), np.array([[3, 1]] * 4), np.ones(4))
    names = (field for field in PathPlan.__dataclass_fields__)
    values = dict.fromkeys(names) | {"planned": trajectory, "times": np.arange(4.0)}
    assert repr(PathPlan(**values)) == "<PathPlan: 50.0 % of failures survived, 4 samples>"
