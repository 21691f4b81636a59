# Joints, the arms that they make, and which of them may fail.
from lockedjoint.formulations.joints.models import arm as arm
from lockedjoint.formulations.joints.arm import Arm as Arm
from lockedjoint.formulations.joints.joint import Joint as Joint
from lockedjoint.formulations.joints.kinds import UnitRevolute as UnitRevolute
from lockedjoint.formulations.joints.kinds import LeverRevolute as LeverRevolute
from lockedjoint.formulations.joints.kinds import Prismatic as Prismatic
from lockedjoint.formulations.joints.kinds import FreeColumn as FreeColumn
from lockedjoint.formulations.measures.unequal_failures import FailureModel as FailureModel

# Statements: what is solved, and what comes out.
from lockedjoint.formulations.solving.solve import solve as solve
from lockedjoint.formulations.solving.outcome import Outcome as Outcome
from lockedjoint.formulations.registry import register as register
from lockedjoint.formulations.joints.models import register_joint as register_joint
from lockedjoint.nlp.multistart import multistart as multistart
from lockedjoint.nlp.problem import Problem as Problem
from lockedjoint.nlp.problem import Constraint as Constraint

# Measures: what a matrix is worth, from the matrix alone.
from lockedjoint.formulations import measures as measures
from lockedjoint.formulations.measures.assessment import measure as measure
from lockedjoint.formulations.measures.canonical import group_equivalent as group_equivalent
from lockedjoint.figures.figures import plot as plot

# Bounds and proof: how good any answer could be.
from lockedjoint.formulations.registry import bound as bound
from lockedjoint.formulations.bounds.certified import Bound as Bound
from lockedjoint.formulations.existence.rings import optimal_jacobian as optimal_jacobian

# Robots: from a Jacobian to a robot, and from a robot to its Jacobian.
from lockedjoint.synthesis.from_jacobian import realise as realise
from lockedjoint.synthesis.choice import choose_arrangement as choose_arrangement
from lockedjoint.synthesis.write_urdf import urdf as urdf
from lockedjoint.robots.robot_arm import RobotArm as RobotArm
from lockedjoint.robots.robot_assessment import measure_robot as measure_robot
from lockedjoint.robots.posture import best_posture as best_posture
from lockedjoint.robots.posture_search import Search as Search
from lockedjoint.robots.pose_constrained_arm import Pose as Pose
from lockedjoint.paths.search import plan_path as plan_path

# After a failure: a trajectory with what is left, or a proof that there is none.
from lockedjoint.recovery.recover import recover as recover
from lockedjoint.recovery.damaged_state import RecoverySearch as RecoverySearch
from lockedjoint.recovery.goal import ToolGoal as ToolGoal
from lockedjoint.recovery.failures import FreeSwinging as FreeSwinging
from lockedjoint.recovery.failures import Locked as Locked
from lockedjoint.recovery.failures import ReducedRange as ReducedRange
from lockedjoint.recovery.failures import ReducedSpeed as ReducedSpeed

# Files: matrices, robots, waypoints, a campaign's records, the best Jacobians known.
from lockedjoint.formulations.measures.read_jacobians import read_jacobians as read_jacobians
from lockedjoint.kinematics.read_robot import read_robot as read_robot
from lockedjoint.paths.waypoints import read_waypoints as read_waypoints
from lockedjoint.formulations.campaign.records import open_store as open_store
from lockedjoint.formulations.campaign.tables import read_campaign as read_campaign
from lockedjoint.formulations.atlas.collection import atlas as atlas
from lockedjoint.formulations.atlas.collection import read_atlas as read_atlas

# Errors: everything that the library raises on purpose.
from lockedjoint.nlp.errors import InputError as InputError
from lockedjoint.nlp.errors import LockedJointError as LockedJointError

__version__: str
