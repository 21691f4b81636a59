"""What others do after a failure: a differential inverse kinematics, or one inverse solution.

*pink* goes from where the arm is towards the goal, by quadratic programs on pinocchio's model
with what has locked fixed and ranges reduced. It knows no obstacles: where it touches some, it
has failed. *RRT-Connect* takes the inverse solution that a
single start, where the arm is, leads to, and plans to it by OMPL.
"""

from functools import lru_cache
from itertools import pairwise, starmap
from typing import Any

import numpy as np
import pinocchio as pin

from formulations.paths.waypoints import ToolPath
from formulations.recovery.along_path import recover_path
from formulations.recovery.configurations import GoalSearch
from formulations.recovery.damaged_state import Connector, DamagedState, RecoverySearch
from formulations.recovery.failures import DamagedArm
from results.recovery.tasks import arm_named, stated

# Of pink: seconds of a step, steps of a goal, samples of a path, and what counts as reached.
_STEP, _STEPS, _SAMPLES, _NEAR = 0.05, 400, 30, 1e-3


def by_one_solution(task: dict[str, Any]) -> str:
    """Say whether RRT-Connect gets to the inverse solution of one start, or along the path."""
    arm, start, goal, clearance = stated(task)
    search = RecoverySearch(starts=1, boxes=1)
    state = DamagedState.of(arm, start, clearance=clearance, search=search)
    if isinstance(goal, ToolPath):
        return "solved" if recover_path(state, goal).trajectory else "unknown"
    ends = GoalSearch(arm, goal, state.start).at_goal(1, np.random.default_rng(0))
    ends = np.array([end for end in ends if state.connector.is_free(end)])
    if not len(ends) or state.connector.rrt_connect(state.start, ends, 5.0, 0) is None:
        return "unknown"
    return "solved"


def by_pink(task: dict[str, Any]) -> str:
    """Say whether pink's inverse kinematics gets to the goal, or along the path."""
    import pink

    arm, start, goal, clearance = stated(task)
    model, q = _model(task["arm"], arm, start)
    configuration = pink.Configuration(model, model.createData(), q)
    base = configuration.get_transform_frame_to_world(arm.chain.base or "universe")
    if isinstance(goal, ToolPath):
        poses = goal.sampled(_SAMPLES, 1.0)[1]
        targets = list(starmap(pin.SE3, zip(poses.rotations, poses.positions, strict=True)))
        oriented = True
    else:
        targets = [pin.SE3(goal.pose.rotation, goal.position)]
        oriented = goal.pose.quaternion is not None
    own = pink.tasks.FrameTask(
        arm.chain.tip, position_cost=1.0, orientation_cost=1.0 if oriented else 0.0
    )
    rows = slice(0, 6 if oriented else 3)
    moving = [model.joints[model.getJointId(name)].idx_v for name in arm.chain.names]
    way = [np.array(start)[arm.free]]
    for target in targets:
        own.set_target(base * target)
        for _ in range(_STEPS):
            if np.max(np.abs(own.compute_error(configuration)[rows])) < _NEAR:
                break
            velocity = pink.solve_ik(
                configuration, [own], _STEP, "daqp", damping=1e-9, safety_break=False
            )
            configuration.integrate_inplace(velocity, _STEP)
            way.append(way[-1] + _STEP * velocity[moving])
        else:
            return "unknown"
    free = all(starmap(Connector(arm.chain, clearance).is_line_free, pairwise(way)))
    return "solved" if free else "unknown"


def _model(name: str, arm: DamagedArm, start: list[float]) -> tuple[Any, Any]:
    """Return pinocchio's model of what can move, and its configuration at the start."""
    whole, places = _whole(name), dict(zip(arm.healthy.names, start, strict=True))
    fixed = [k for k, joint in enumerate(whole.names) if k and joint not in arm.chain.names]
    model = pin.buildReducedModel(whole, fixed, _configuration(whole, places))
    for joint in arm.chain.joints:
        own = model.joints[model.getJointId(joint.name)]
        if own.nq == 1:  # of joints that turn without limits pinocchio has cosine and sine
            model.lowerPositionLimit[own.idx_q] = joint.lower
            model.upperPositionLimit[own.idx_q] = joint.upper
            model.velocityLimit[own.idx_v] = min(joint.velocity, 1e3)
    return model, _configuration(model, places)


@lru_cache(maxsize=4)
def _whole(name: str) -> Any:
    return pin.buildModelFromUrdf(str(arm_named(name).path))


def _configuration(model: Any, places: dict[str, float]) -> Any:
    move = np.zeros(model.nv)
    for name in places.keys() & set(model.names):
        move[model.joints[model.getJointId(name)].idx_v] = places[name]
    return pin.integrate(model, pin.neutral(model), move)
