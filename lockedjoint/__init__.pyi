# Statements: what is solved, and what comes out.
# Measures: what a matrix is worth, from the matrix alone.
from formulations import measures as measures

# Bounds: how good any answer could be.
from formulations.bounds.certified import Bound as Bound
from formulations.bounds.so3_moments.max_min_bound import max_min_bound as max_min_bound
from formulations.bounds.so3_moments.residual_bound import residual_bound as residual_bound
from formulations.bounds.so3_moments.residual_bound import (
    rigorous_residual_bound as rigorous_residual_bound,
)

# Proof: optimally failure-tolerant nR Jacobians exist for every n from 8 on, and not for 7.
from formulations.existence.rings import optimal_jacobian as optimal_jacobian
from formulations.io.jacobians import read_jacobians as read_jacobians
from formulations.joints.arm import Arm as Arm
from formulations.joints.kinds import FreeColumn as FreeColumn
from formulations.joints.kinds import LeverRevolute as LeverRevolute
from formulations.joints.kinds import Prismatic as Prismatic
from formulations.joints.kinds import UnitRevolute as UnitRevolute

# Joints, the arms that they make, and which of them may fail.
from formulations.joints.models import arm as arm
from formulations.joints.models import register_joint as register_joint
from formulations.measures.assessment import Assessment as Assessment
from formulations.measures.assessment import measure as measure
from formulations.measures.canonical import canonical_form as canonical_form
from formulations.measures.canonical import group_equivalent as group_equivalent
from formulations.measures.unequal_failures import FailureModel as FailureModel

# Figures: of what is computed.
from formulations.plot.values import plot as plot

# Robots: from a Jacobian to a robot, and from a robot to its Jacobian.
from formulations.realise.choice import choose_arrangement as choose_arrangement
from formulations.realise.from_jacobian import realise as realise
from formulations.realise.write_urdf import urdf as urdf
from formulations.registry import bound as bound
from formulations.registry import formulation as formulation
from formulations.registry import register as register
from formulations.robots.chain_between import chain_between as chain_between
from formulations.robots.clearance import read_clearance as read_clearance
from formulations.robots.held_pose import Pose as Pose
from formulations.robots.path import plan_path as plan_path
from formulations.robots.posture import best_posture as best_posture
from formulations.robots.read_robot import read_robot as read_robot
from formulations.robots.read_urdf import read_urdf as read_urdf
from formulations.robots.robot_arm import RobotArm as RobotArm
from formulations.robots.robot_assessment import RobotAssessment as RobotAssessment
from formulations.robots.robot_assessment import measure_robot as measure_robot
from formulations.robots.structural import StructuralFailure as StructuralFailure
from formulations.robots.structural import structural_failures as structural_failures
from formulations.robots.waypoints import read_waypoints as read_waypoints
from formulations.solving.case import Case as Case
from formulations.solving.outcome import Outcome as Outcome
from formulations.solving.record import Record as Record
from formulations.solving.solve import solve as solve

# Errors: everything that the library raises on purpose.
from nlp.errors import InputError as InputError
from nlp.errors import LockedJointError as LockedJointError
from nlp.multistart import multistart as multistart

__version__: str
