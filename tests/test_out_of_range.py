"""What is out of range is refused with words that name it, before any work."""

from functools import partial
from math import inf, nan

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import lockedjoint as lj
from lockedjoint.formulations import (
    condition,
    isotropy,
    isotropy_equations,
    manipulability,
    max_min,
    residual,
)
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector
from lockedjoint.formulations.bounds.planar import planar_bound
from lockedjoint.formulations.bounds.two_point import two_point_bound
from lockedjoint.formulations.existence.exact_jacobian import MOST_JOINTS
from lockedjoint.formulations.existence.rings import exact_jacobian
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.formulations.measures import eigenvalue_bound
from lockedjoint.nlp.problem import Constraint, Problem
from lockedjoint.nlp.solver import Solver

# Words of the sentence, what is called, and with which arguments.
ONE_EACH = "sizes is .* one positive size for each trace"
SECTORS = [(1, 0, 0, 4), (2, 2, 0, 3), (-2, 0, 0, 4), (0, 1, 0, 4, 0), (1, 0, 0, 4, 0)]
SECTORS += [(0, 0, 0, 4, 2), (None, 0, 0, 3), (None, 0, 0, 2, 1)]
BOUNDS = [
    *(("trace is", eigenvalue_bound, 6, 7, trace) for trace in (-1.0, nan, inf)),
    ("joints is 6", eigenvalue_bound, 6, 6, 1.0),
    ("task dimension is 0", eigenvalue_bound, 0, 7, 1.0),
    ("joints is 2", planar_bound, 2, 1, 1.0),
    ("failures is 4", planar_bound, 5, 4, 1.0),
    ("level is 0", planar_bound, 5, 2, 0.0),
    ("level is nan", planar_bound, 5, 2, nan),
    ("measure is residual", planar_bound, 5, 2, 1.0, "residual"),
    ("task dimension is 1", two_point_bound, 1, 5),
    ("joints is 4", two_point_bound, 3, 4),
    ("joints is 61", two_point_bound, 2, 61),
    ("task dimension is 13", two_point_bound, 13, 20),
    *(("allowed: ", RowSector, *sector) for sector in SECTORS),
    *(("six joints or fewer", exact_jacobian, joints) for joints in (1, 6)),
    *(("six joints or fewer", lj.optimal_jacobian, joints) for joints in (1, 6)),
    ("for seven it is proved that there is none", exact_jacobian, 7),
    ("for seven it is proved that there is none", lj.optimal_jacobian, 7),
    ("the proof for all", exact_jacobian, MOST_JOINTS + 1),
]

SEVEN, EIGHT = (lj.arm("unit-revolute", joints) for joints in (7, 8))
PLANAR, LEVERS, SLIDING = (
    lj.arm("free", 3, 2),
    lj.arm("lever-revolute", 7),
    lj.arm("prismatic", 7),
)
ALIKE, STATED = lj.FailureModel.equally_likely, max_min.WITHOUT_FACTORS
SPARING = ALIKE(8, never=[0])
NOT_TWO = "at most the degree of redundancy, 1"
STATEMENTS = [
    *((NOT_TWO, one.build, SEVEN, 2) for one in (condition, isotropy, manipulability, max_min)),
    *(
        ("only max-min", one.build, SEVEN, ALIKE(7))
        for one in (condition, isotropy, manipulability)
    ),
    ("at least 1", max_min.build, SEVEN, 0),
    ("shared-factor", max_min.build, SEVEN, 1, "other"),
    ("keep full rank", max_min.build, SLIDING, 1, "shared-factor"),
    ("7 of them", max_min.build, SEVEN, ALIKE(6)),
    ("degree of redundancy, 1", max_min.build, SEVEN, ALIKE(7, 2)),
    ("worst, expected", partial(max_min.build, failures=ALIKE(7), maximise="best"), SEVEN),
    ("shared-factor", max_min.build, SEVEN, ALIKE(7), "other"),
    ("keep full rank", partial(max_min.build, failures=ALIKE(7)), SLIDING),
    *(
        ("isotropy defect", partial(max_min.build, largest_defect=defect), PLANAR)
        for defect in (0.0, -1.0, -inf, nan, True)
    ),
    *(("one of shared-factor", max_min.build, EIGHT, 2, encoding) for encoding in STATED),
    *(("one of shared-factor", max_min.build, EIGHT, SPARING, encoding) for encoding in STATED),
    ("invariant, paper", partial(residual.build, weighting="other"), SEVEN),
    ("derived, appendix", partial(residual.build, rows="printed"), SEVEN),
    ("unit revolute joints only", partial(residual.build, rows="appendix"), LEVERS),
    ("exact, gauss-newton", partial(residual.build, hessian="other"), SEVEN),
    ("invariant", partial(residual.build, weighting="paper", hessian="gauss-newton"), SEVEN),
    *(
        ("three angles per joint", isotropy_equations.closed_forms, ca.SX.sym("x", n))
        for n in (0, 20)
    ),
]

by_fatrop = partial(Solver, name="fatrop")
ARMS = [lj.arm(one, 8) for one in ("lever-revolute", "unit-revolute:6,prismatic:2")]
X = ca.SX.sym("x", 2)
a_problem = partial(Problem, "p", X)
PROBLEMS = [
    *(("starts is", partial(lj.multistart, starts=bad), list, list) for bad in (0, 2.5, True)),
    *(("rng is", partial(lj.multistart, starts=1, rng=bad), list, list) for bad in (-1, 1.0)),
    ("workers is", partial(lj.multistart, starts=1, workers=0), list, list),
    *(("fatrop for max-min", by_fatrop, max_min.build(one, 1, "two-stage")) for one in ARMS),
    ("fatrop for max-min", by_fatrop, max_min.build(EIGHT, 1, "schur-complement")),
    ("sense is minimize; allowed: one of minimise, maximise.", a_problem, X[0], "minimize"),
    (r"bounds of lower is of shape", partial(a_problem, lower=np.zeros(3)), X[0]),
    ("NaN", partial(a_problem, lower=np.array([0.0, nan])), X[0]),
    ("lower <= upper", partial(a_problem, lower=1.0, upper=0.0), X[0]),
    ("objective is an expression of shape", a_problem, ca.SX.zeros(2)),
    ("stranger", a_problem, ca.SX.sym("stranger")),
    ("a column of SX symbols", Problem, "p", X + 1, X[0]),
    (r"\[1, 0\] in row 1", Constraint, "c", X, np.array([0.0, 1.0]), 0.0),
]

MODELS = [
    ("both brackets", lj.arm, "lever-revolute(length=0.3:6"),
    ("length=NUMBER or pitch=NUMBER in brackets", lj.arm, "lever-revolute(speed=1):7"),
    ("length=NUMBER or pitch=NUMBER in", lj.arm, "lever-revolute(length=x):7"),
    ("length is -1", lj.arm, "lever-revolute(length=-1):7"),
    ("nothing in brackets", lj.arm, "unit-revolute(length=1):7"),
    ("a count of at least 1", lj.arm, "unit-revolute:7:8"),
    ("joints is missing", lj.arm, "unit-revolute"),
    ("one of unit-revolute", lj.arm, "," * 999),
    *(("NAME", lj.arm, name) for name in ("x" * 2000, 3)),
    *(
        ("a name, an Arm, a RobotArm or a row of joints", lj.solve, "max-min", model)
        for model in (3, None, [1, 2], [[]])
    ),
    *(("allowed: ", lj.Arm.of, UnitRevolute(), joints) for joints in (6, 0)),
    ("allowed: ", lj.Arm, (FreeColumn(2), FreeColumn(3), FreeColumn(2), FreeColumn(2))),
    ("allowed: ", FreeColumn, 0),
    ("allowed: ", partial(FreeColumn, norm=-1), 2),
    ("allowed: ", partial(FreeColumn, budget="none"), 2),
    ("allowed: ", partial(LeverRevolute, length=nan)),
    ("allowed: ", partial(LeverRevolute, budget="all")),
    ("allowed: ", partial(LeverRevolute, pitch=inf)),
    *(("allowed: ", partial(Prismatic, speed=speed)) for speed in (inf, True)),
]

J = np.random.default_rng(0).normal(size=(6, 8))
two = lj.FailureModel((0.1, 0.1))
one, many = lj.measures.worst_case_sigma, lj.measures.worst_case_sigma_batch
smooth = lj.measures.smooth_worst_case_batch
MATRICES = [
    *(
        ("jacobian is", one, bad)
        for bad in (np.zeros((3, 3)), np.zeros(4), np.zeros((0, 3)), None)
    ),
    *(("jacobian is", one, [[1, 2, bad], [1, 2, 3]]) for bad in (nan, inf)),
    ("jacobian is", one, [["a", "b", "c"], [1, 2, 3]]),
    ("jacobian is", one, [[1, 2, 3], [1, 2]]),
    *((r"1e-70 to 1e\+70", lj.measure, J * x) for x in (1e-200, 1e-160, 1e-71, 1e70, 1e160)),
    ("masked", lj.measure, np.ma.masked_greater(J, 1)),
    ("over all failures", lj.measure, np.ones((2, 10_000))),
    (r"shape \(6, 7\)", many, np.zeros((6, 7))),
    ("more joints n than", many, np.zeros((2, 6, 6))),
    ("more joints n than", many, np.zeros((2, 0, 3))),
    ("real numbers", many, [[["a", "b"]]]),
    ("Jacobian 1 is not finite", many, np.array([np.zeros((2, 3)), np.full((2, 3), nan)])),
    ("Jacobian 0 is not finite or too large", many, np.full((1, 2, 3), 1e80)),
    *(("width is .*allowed", smooth, np.ones((1, 2, 3)), width) for width in (0, -1.0, nan)),
    *(("width is .*allowed", smooth, np.ones((1, 2, 3)), width) for width in ("wide", True)),
    ("0, or from 1e-12", lj.FailureModel, (0.1, -0.1)),
    *(("from 1e-12 to 1", lj.FailureModel, (0.1, bad)) for bad in (1.0, nan, True, "0.1")),
    ("that may fail, 0", lj.FailureModel, (0.0, 0.0)),
    ("that may fail, 1", lj.FailureModel, (0.1, 0.0), 2),
    ("at least 1", lj.FailureModel, (0.1, 0.1), 0),
    ("at most 1", two.sparing, [2]),
    ("at least 0", two.sparing, [-1]),
    ("at least 1", lj.measures.sigma_bound, 3, 5, 1.0, 0),
    ("at most 2", lj.measures.averaged_spectrum, np.ones(3), 5, 3),
]

ROBOTS = [
    ("position is", lj.Pose, (1.0, 2.0, nan)),
    ("quaternion is", lj.Pose, (0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0)),
    ("only where the pose has an orientation", partial(lj.Pose, angle=0.1), (0.0, 0.0, 0.0)),
    *(
        ("robot is of type", lj.Robot, source)
        for source in (None, 7, {}, b"robot.urdf", pin.SE3.Identity())
    ),
    ("of type ndarray; allowed: an Assessment", lj.plot, J),
    ("size", partial(lj.plot, size="big"), lj.measure(J)),
]

CASES = [*BOUNDS, *STATEMENTS, *PROBLEMS, *MODELS, *MATRICES, *ROBOTS]


@pytest.mark.parametrize("case", CASES, ids=range(len(CASES)))
def test_what_is_out_of_range_is_named(case):
    words, call, *arguments = case
    with pytest.raises(lj.InputError, match=words):
        call(*arguments)
