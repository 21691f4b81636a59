# Joints, the arms that they make, and which of them may fail.
from formulations.joints.models import arm as arm
from formulations.joints.arm import Arm as Arm
from formulations.joints.joint import Joint as Joint
from formulations.joints.kinds import UnitRevolute as UnitRevolute
from formulations.joints.kinds import LeverRevolute as LeverRevolute
from formulations.joints.kinds import Prismatic as Prismatic
from formulations.joints.kinds import FreeColumn as FreeColumn
from formulations.measures.unequal_failures import FailureModel as FailureModel

# Statements: what is solved, and what comes out.
from formulations.solving.solve import solve as solve
from formulations.solving.outcome import Outcome as Outcome
from formulations.registry import register as register
from formulations.joints.models import register_joint as register_joint
from nlp.multistart import multistart as multistart
from nlp.problem import Problem as Problem
from nlp.problem import Constraint as Constraint

# Measures: what a matrix is worth, from the matrix alone.
from formulations import measures as measures
from formulations.measures.assessment import measure as measure
from formulations.measures.canonical import group_equivalent as group_equivalent
from formulations.plot.figures import plot as plot

# Bounds and proof: how good any answer could be.
from formulations.registry import bound as bound
from formulations.bounds.certified import Bound as Bound
from formulations.existence.rings import optimal_jacobian as optimal_jacobian

# Robots: from a Jacobian to a robot, and from a robot to its Jacobian.
from formulations.synthesis.from_jacobian import realise as realise
from formulations.synthesis.choice import choose_arrangement as choose_arrangement
from formulations.synthesis.write_urdf import urdf as urdf
from formulations.robots.robot_arm import RobotArm as RobotArm
from formulations.robots.robot_assessment import measure_robot as measure_robot
from formulations.robots.posture import best_posture as best_posture
from formulations.robots.posture_search import Search as Search
from formulations.robots.pose_constrained_arm import Pose as Pose
from formulations.paths.search import plan_path as plan_path

# After a failure: a trajectory with what is left, or a proof that there is none.
from formulations.recovery.recover import recover as recover
from formulations.recovery.damaged_state import RecoverySearch as RecoverySearch
from formulations.recovery.goal import ToolGoal as ToolGoal
from formulations.recovery.failures import FreeSwinging as FreeSwinging
from formulations.recovery.failures import Locked as Locked
from formulations.recovery.failures import ReducedRange as ReducedRange
from formulations.recovery.failures import ReducedSpeed as ReducedSpeed

# Files: matrices, robots, waypoints, a campaign's records, the best Jacobians known.
from formulations.measures.read_jacobians import read_jacobians as read_jacobians
from formulations.kinematics.read_robot import read_robot as read_robot
from formulations.paths.waypoints import read_waypoints as read_waypoints
from formulations.campaign.records import open_store as open_store
from formulations.campaign.tables import read_campaign as read_campaign
from formulations.atlas.collection import atlas as atlas
from formulations.atlas.collection import read_atlas as read_atlas

# Errors: everything that the library raises on purpose.
from nlp.errors import InputError as InputError
from nlp.errors import LockedJointError as LockedJointError

__version__: str
