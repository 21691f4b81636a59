# Joints, the arms that they make, and which of them may fail.
from lockedjoint.formulations.joints.models import arm as arm
from lockedjoint.formulations.joints.arm import Arm as Arm
from lockedjoint.formulations.joints.joint import Joint as Joint
from lockedjoint.formulations.joints.kinds import UnitRevolute as UnitRevolute
from lockedjoint.formulations.joints.kinds import LeverRevolute as LeverRevolute
from lockedjoint.formulations.joints.kinds import Prismatic as Prismatic
from lockedjoint.formulations.joints.kinds import FreeColumn as FreeColumn
from lockedjoint.formulations.measures.unequal_failures import FailureModel as FailureModel

# Formulations: how they are stated and solved.
from lockedjoint.formulations.solving.solve import solve as solve
from lockedjoint.formulations.solving.outcome import Outcome as Outcome
from lockedjoint.formulations.comparison import compare as compare
from lockedjoint.formulations.registry import register as register
from lockedjoint.formulations.registry import Formulation as Formulation
from lockedjoint.formulations.registry import FORMULATIONS as FORMULATIONS
from lockedjoint.formulations.joints.models import register_joint as register_joint
from lockedjoint.nlp.multistart import multistart as multistart
from lockedjoint.nlp.problem import Problem as Problem
from lockedjoint.nlp.problem import Constraint as Constraint
from lockedjoint.nlp.solver import Solver as Solver

# Measures: how failure tolerant a matrix or a robot is.
from lockedjoint.formulations import measures as measures
from lockedjoint.robots.measure import measure as measure
from lockedjoint.formulations.measures.canonical import group_equivalent as group_equivalent
from lockedjoint.formulations.measures.canonical import canonical_form as canonical_form
from lockedjoint.figures.figures import plot as plot

# Bounds and proof: how good any answer could be.
from lockedjoint.formulations.registry import bound as bound
from lockedjoint.formulations.bounds.certified import Bound as Bound
from lockedjoint.formulations.bounds.relaxed import relaxed as relaxed
from lockedjoint.formulations.joints.gram_conditions import trace_condition as trace_condition
from lockedjoint.formulations.existence.rings import optimal_jacobian as optimal_jacobian
from lockedjoint.formulations.existence.verify import excludes as excludes
from lockedjoint.formulations.existence.verify import verified as verified
from lockedjoint.formulations.existence.verify import verify_nonexistence as verify_nonexistence

# The mathematics: one formulation in each module, and the numbers of the paper.
from lockedjoint.formulations import residual as residual
from lockedjoint.formulations import max_min as max_min
from lockedjoint.formulations import isotropy as isotropy
from lockedjoint.formulations import relaxation as relaxation
from lockedjoint.formulations import isotropy_equations as isotropy_equations
from lockedjoint.formulations.reproduction import reference as reference
from lockedjoint.formulations.reproduction import eight_joints as eight_joints
from lockedjoint.formulations.reproduction import sections_2_and_3 as sections_2_and_3

# From a Jacobian to a robot.
from lockedjoint.synthesis.from_jacobian import realise as realise
from lockedjoint.synthesis.choice import choose_arrangement as choose_arrangement
from lockedjoint.synthesis.criteria import register_criterion as register_criterion
from lockedjoint.synthesis.write_urdf import urdf as urdf

# A robot that exists: the object, and functions of it (`measure` is above).
from lockedjoint.robot import Robot as Robot
from lockedjoint.kinematics.in_degrees import InDegrees as InDegrees
from lockedjoint.kinematics.pose import Pose as Pose
from lockedjoint.kinematics.task_space import TaskSpace as TaskSpace
from lockedjoint.clearance.read_clearance import Obstacles as Obstacles
from lockedjoint.robots.posture import posture as posture
from lockedjoint.robots.search import Search as Search
from lockedjoint.paths.search import path as path
from lockedjoint.paths.path_search import PathSearch as PathSearch
from lockedjoint.paths.waypoints import ToolPath as ToolPath
from lockedjoint.workspaces.of_robot import workspace as workspace
from lockedjoint.workspaces.of_robot import prove_workspace as prove_workspace
from lockedjoint.viewer.view import view as view
from lockedjoint.robots.worst_case_code import codegen as codegen

# After a failure: a trajectory of the joints that are left, or a proof that there is none.
from lockedjoint.recovery.recover import recover as recover
from lockedjoint.recovery.recovery_search import RecoverySearch as RecoverySearch
from lockedjoint.recovery.goal import ToolGoal as ToolGoal
from lockedjoint.recovery.failures import FreeSwinging as FreeSwinging
from lockedjoint.recovery.failures import Locked as Locked
from lockedjoint.recovery.failures import ReducedRange as ReducedRange
from lockedjoint.recovery.failures import ReducedSpeed as ReducedSpeed

# The worst case inside other tools: each module imports its tool.
from lockedjoint.adapters import jax as jax
from lockedjoint.adapters import mink as mink
from lockedjoint.adapters import pink as pink
from lockedjoint.adapters import placo as placo

# Files: matrices, robots, waypoints, a campaign's records, the best Jacobians known.
from lockedjoint.formulations.measures.read_jacobians import read_jacobians as read_jacobians
from lockedjoint.paths.waypoints import read_waypoints as read_waypoints
from lockedjoint.paths.read_plan import read_plan as read_plan
from lockedjoint.formulations.campaign.records import open_store as open_store
from lockedjoint.formulations.campaign.tables import read_campaign as read_campaign
from lockedjoint.formulations.atlas.collection import atlas as atlas
from lockedjoint.formulations.atlas.collection import read_atlas as read_atlas
from lockedjoint.formulations.existence.reading import read_certificate as read_certificate

# Errors: everything that the library raises on purpose.
from lockedjoint.formulations.existence.certificate import CertificateError as CertificateError
from lockedjoint.formulations.joints.joint import NotInModelError as NotInModelError
from lockedjoint.nlp.errors import InputError as InputError
from lockedjoint.nlp.errors import SolverOptionError as SolverOptionError
from lockedjoint.nlp.errors import LockedJointError as LockedJointError

__version__: str
