"""Ways between configurations: a straight line of the joints, or RRT-Connect around links.

Configurations have the shape (n,), n joints in radians, those of sliders in metres. A way has
K corners, shape (K, n), and the joints move evenly from one to the next. Links keep their
distance at the corners and everywhere between, see `ClearMotion`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

# A joint without limits may be planned to go this far to each side of both ends: a turn.
_BEYOND_M_OR_RAD = 2 * np.pi


@dataclass(frozen=True)
class SearchLimit:
    """When RRT-Connect gives up: after so many random samples, or so many seconds.

    A number of samples is the same on every machine. Seconds, of a clock on the wall, are for
    a user who states them: what is found then depends on how fast and how busy a machine is.
    """

    samples: int | None = None
    seconds: float | None = None

    def condition(self) -> Callable[[], bool]:
        """Return what RRT-Connect asks before each sample: whether it has to end.

        The time begins now.
        """
        asked = count()
        end = 0.0 if self.seconds is None else time.monotonic() + self.seconds

        def is_over() -> bool:
            if self.samples is not None and next(asked) >= self.samples:
                return True
            return self.seconds is not None and time.monotonic() >= end

        return is_over

    def __str__(self) -> str:
        """Say the limit with its unit."""
        parts = []
        if self.samples is not None:
            parts.append(f"{self.samples} samples")
        if self.seconds is not None:
            parts.append(f"{self.seconds:g} s")
        return " or ".join(parts)


@dataclass(frozen=True, eq=False)
class Connector:
    """Finds ways of a chain's joints, along which links stay apart if a distance is given."""

    chain: Chain
    clearance: LinkClearance | None = None

    def is_free(self, q: FloatArray) -> bool:
        """Whether links are apart at a configuration, shape (n,)."""
        return self.clearance is None or bool(self.clearance.is_kept(q[:, None])[0])

    def check_free(self, argument: str, q: FloatArray) -> None:
        """Raise InputError, with the pair that is too near, unless links are apart at q, (n,).

        The argument is how the error names the configuration.
        """
        if self.clearance is None or self.is_free(q):
            return
        missing = self.clearance.leasts - self.clearance.gaps(q[:, None])[:, 0]
        worst = int(np.argmax(missing))
        pair = self.clearance.closest(q, [self.clearance.pairs[worst]])
        first, second = pair.links
        value = f"in collision: {first} and {second} touch"
        if pair.distance > 0:
            value = f"where {first} and {second} are {pair.distance:.3g} m apart"
        least = float(self.clearance.leasts[worst])
        raise InputError(argument, value, f"where they are at least {least:.3g} m apart")

    def is_line_free(self, start: FloatArray, end: FloatArray) -> bool:
        """Whether links keep their distance along a straight line."""
        return self.motion is None or bool(self.motion.clear(start[:, None], end[:, None])[0])

    @cached_property
    def motion(self) -> ClearMotion | None:
        """What tells whether links keep their distance along ways; None if they may touch."""
        if self.clearance is None:
            return None
        return ClearMotion(self.clearance, self.chain, kept=True)

    def way(
        self, start: FloatArray, ends: FloatArray, limit: SearchLimit, seed: int
    ) -> FloatArray | None:
        """Return corners of a way from the start to one of some free ends, shape (K, n).

        `ends` has the shape (E, n). None if RRT-Connect finds none within the limit.
        """
        for end in ends:
            if self.is_line_free(start, end):
                return np.stack([start, end])
        corners = self.rrt_connect(start, ends, limit, seed)
        return None if corners is None else self._shortened(corners)

    def rrt_connect(
        self, start: FloatArray, ends: FloatArray, limit: SearchLimit, seed: int
    ) -> FloatArray | None:
        """Return corners of a way by OMPL's RRT-Connect, (K, n), or None.

        It ends without a way where the limit ends it. One seed gives one answer on every
        machine, however busy, if the limit is a number of samples.
        """
        ompl = library("ompl.base", "ompl.geometric", "ompl.util")
        base, geometric = ompl.base, ompl.geometric
        ompl.util.setLogLevel(ompl.util.LOG_NONE)
        ompl.util.RNG.setSeed(seed + 1)
        size = len(start)
        space = base.RealVectorStateSpace(size)
        bounds = base.RealVectorBounds(size)
        lower, upper = self.chain.limits
        around = np.vstack([start, ends])
        lower = np.where(np.isfinite(lower), lower, around.min(axis=0) - _BEYOND_M_OR_RAD)
        upper = np.where(np.isfinite(upper), upper, around.max(axis=0) + _BEYOND_M_OR_RAD)
        for k in range(size):
            bounds.setLow(k, float(lower[k]))
            bounds.setHigh(k, float(upper[k]))
        space.setBounds(bounds)

        def point(state: Any) -> FloatArray:
            return np.array([state[k] for k in range(size)])

        def state_of(q: FloatArray) -> Any:
            state = space.allocState()
            for k in range(size):
                state[k] = float(q[k])
            return state

        line_free = self.is_line_free

        class Lines(base.MotionValidator):  # type: ignore[misc, name-defined]
            """Looks at straight lines as closely as distances ask for."""

            def checkMotion(self, first: Any, second: Any, *_: Any) -> bool:
                return line_free(point(first), point(second))

        task = geometric.SimpleSetup(space)
        information = task.getSpaceInformation()
        information.setStateValidityChecker(lambda state: self.is_free(point(state)))
        information.setMotionValidator(Lines(information))
        task.setStartState(state_of(start))
        goals = base.GoalStates(information)
        for end in ends:
            goals.addState(state_of(end))
        task.setGoal(goals)
        task.setPlanner(geometric.RRTConnect(information))
        task.solve(base.PlannerTerminationCondition(limit.condition()))
        if not task.haveExactSolutionPath():
            return None
        return np.array([point(state) for state in task.getSolutionPath().getStates()])

    def _shortened(self, corners: FloatArray) -> FloatArray:
        """Leave out corners as long as straight lines past them are free."""
        kept, at = [corners[0]], 0
        while at < len(corners) - 1:
            later = range(len(corners) - 1, at + 1, -1)
            at = next((k for k in later if self.is_line_free(corners[at], corners[k])), at + 1)
            kept.append(corners[at])
        return np.array(kept)
