"""A pose, or a position, after failures: with what is left, or why not."""

from __future__ import annotations

import numpy as np

from formulations.recovery.answers import Impossible, NotFound, Recovered, Recovery
from formulations.recovery.checking import faults
from formulations.recovery.configurations import GoalSearch
from formulations.recovery.damaged_state import DamagedState
from formulations.recovery.goal import ToolGoal
from formulations.recovery.helping import help_at
from nlp.arrays import FloatArray

# Starts of the first round, and boxes of the first proof: what is easy is known soon.
_FIRST_STARTS, _FIRST_BOXES = 60, 20_000
# Ends that RRT-Connect may choose from.
_ENDS = 30


def recover_pose(state: DamagedState, goal: ToolGoal) -> Recovery:
    """Reach a pose from where a damaged arm is, or say why not; see `recover`."""
    search, tried = state.search, []
    rng = np.random.default_rng(search.seed)
    rounds = (
        [_FIRST_STARTS, search.starts] if search.starts > _FIRST_STARTS else [search.starts]
    )
    for starts, boxes in zip(rounds, (_FIRST_BOXES, search.boxes), strict=False):
        ends = GoalSearch(state.arm.chain, goal, state.start).at_goal(starts, rng)
        tried.append(f"{starts} starts: {len(ends)} configurations at the goal")
        free = [end for end in ends if state.connector.is_free(end)]
        if state.connector.clearance is not None:
            tried.append(f"{len(free)} of them with links apart")
        if free:
            answer = _along_a_way(state, goal, np.array(free[:_ENDS]), tried)
            if answer is not None:
                return answer
        if not len(ends):
            proof = state.proof(goal, min(boxes, search.boxes))
            if proof is not None:
                tried.append(f"a proof of {proof.boxes} boxes")
                return Impossible(
                    proof, help_at(state.arm, goal, state.start, rng), tuple(tried)
                )
            tried.append(f"no proof with {min(boxes, search.boxes)} boxes")
    return NotFound(help_at(state.arm, goal, state.start, rng), tuple(tried))


def _along_a_way(
    state: DamagedState, goal: ToolGoal, ends: FloatArray, tried: list[str]
) -> Recovered | None:
    """Return a checked trajectory to one of some configurations, None if there is none."""
    corners = state.connector.way(state.start, ends, state.search.seconds, state.search.seed)
    if corners is None:
        tried.append(f"RRT-Connect for {state.search.seconds:g} s: no way")
        return None
    run = state.run_along(corners, range(len(corners)))
    wrong = faults(state.arm, state.whole, goal, run, state.connector.clearance)
    tried.append(f"a way with {len(corners) - 2} corners: {', '.join(wrong) or 'it is right'}")
    return None if wrong else Recovered(run, len(corners) - 2, tuple(tried))
