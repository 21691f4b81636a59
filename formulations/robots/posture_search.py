"""The search for a posture: what is looked for, and what many random starts lead to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from formulations import catalogue, max_min, measures, unequal_max_min
from formulations.measures.unequal_failures import Scenarios, scenarios
from formulations.robots.chain import LARGEST
from formulations.robots.held_pose import HeldArm
from formulations.robots.robot_arm import RobotArm
from formulations.robots.structural import structural_failures
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.multistart import Run, Study, multistart
from nlp.problem import Problem
from nlp.solution import ACCEPTABLE, SUCCESS

# A start is the best of so many random configurations: a robot has many poor optima, and
# near-singular postures from which max-min hardly moves.
DRAWS = 64
# Max-min on robots: an adaptive barrier loses fewer starts; for joints to be designed it is the
# other way round. The last two are Ipopt's defaults, which some encodings change.
OPTIONS: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        max_min.NAME: {
            "mu_strategy": "adaptive",
            "max_iter": 150,
            "mu_init": 0.1,
            "barrier_tol_factor": 10.0,
        }
    }
)
# A polished posture may be worse by this share, which is rounding.
_SAME = 1e-9
# In one stage: a start is chosen for its worst case, which a residual stage would lose.
_ENCODING = "reduced"


@dataclass(frozen=True)
class Search:
    """How to look for a posture.

    Attributes
    ----------
    formulation
        A name in `formulations.catalogue`.
    locked
        How many joints lock at once; other than 1 if the formulation has that setting.
    failures, goal
        How likely each failure is, and what is maximised then; see `unequal_max_min`. Of
        max-min. All joints alike if left out.
    probabilities_known
        Whether the probabilities mean anything beyond their ratios.
    starts, seed, workers
        See `nlp.multistart.multistart`.
    options
        Ipopt options, over the formulation's own.
    progress
        Whether to show a progress bar on a terminal.
    """

    formulation: str = max_min.NAME
    locked: int = 1
    starts: int = 100
    seed: int = 0
    workers: int = 1
    options: Mapping[str, object] = field(default_factory=dict)
    progress: bool = False
    failures: Scenarios | None = None
    probabilities_known: bool = True
    goal: unequal_max_min.Goal = "worst"

    def __post_init__(self) -> None:
        settings = catalogue.formulation(self.formulation).SETTINGS
        unequal_max_min.checked_goal(self.goal)
        if self.failures is not None:
            if "failures" not in settings:
                allowed = f"none for the formulation {self.formulation}"
                raise InputError("failure probabilities", "given", allowed)
            given = scenarios(self.failures)[0].locked
            if given != self.locked:
                raise InputError(
                    "locked joints", self.locked, f"{given}, as in the failure model"
                )
        elif self.goal != "worst":
            raise InputError("goal", self.goal, "worst where all failures are alike")
        if self.locked != 1 and "locked" not in settings:
            allowed = f"1 for the formulation {self.formulation}"
            raise InputError("locked joints", self.locked, allowed)


@dataclass(frozen=True, eq=False)
class Candidate:
    """The posture from one start, within the limits, measured from its J alone.

    The merit is NaN if the posture does not satisfy the formulation. `polished` is whether
    `max_min.Polish` converged, None where it was not called.
    """

    return_status: str
    merit: float
    worst_case_sigma: float
    configuration: FloatArray
    polished: bool | None = None

    @property
    def converged(self) -> bool:
        """Whether the posture is an optimum, as far as the solver or the polish says."""
        if self.polished is not None:
            return self.polished
        return self.return_status in (SUCCESS, ACCEPTABLE)


def candidates(arm: RobotArm, search: Search) -> Study[Candidate]:
    """Look for a posture from every start."""
    stated = catalogue.formulation(search.formulation)
    # Where hardly anything is left, Ipopt's tolerances are not small beside t.
    # A pose to keep, or unequal failures, are not what the polish knows of.
    free = search.failures is None and not isinstance(arm, HeldArm)
    near = free and "encoding" in stated.SETTINGS and bool(structural_failures(arm))
    polish = max_min.Polish(arm, search.locked) if near else None
    own = OPTIONS.get(search.formulation, stated.OPTIONS)
    return multistart(
        partial(problem, arm, search),
        partial(_promising_start, arm=arm, search=search),
        starts=search.starts,
        rng=search.seed,
        workers=search.workers,
        options={**own, **search.options},
        label=f"{search.formulation} {arm.chain.robot}" if search.progress else None,
        judge=partial(_judge, arm=arm, search=search, polish=polish),
        figure=lambda candidate: candidate.merit,
    )


def problem(arm: RobotArm, search: Search) -> Problem:
    """State the search as a nonlinear program."""
    stated = catalogue.formulation(search.formulation)
    if search.failures is not None:
        return unequal_max_min.build(arm, search.failures, search.goal)
    taken: dict[str, Any] = {"locked": search.locked} if "locked" in stated.SETTINGS else {}
    if "encoding" in stated.SETTINGS and search.locked == 1:
        taken["encoding"] = _ENCODING
    build: Callable[..., Problem] = stated.build
    return build(arm, **taken)


def _promising_start(rng: np.random.Generator, arm: RobotArm, search: Search) -> FloatArray:
    """Draw configurations at random and return the one with the best worst case."""
    drawn = [arm.sample(rng) for _ in range(DRAWS)]

    def left(point: FloatArray) -> float:
        if search.failures is None:
            return measures.worst_case_sigma(arm.jacobian(point), search.locked)
        return unequal_max_min.merit(arm.jacobian(point), search.failures, search.goal)

    return max(drawn, key=left)


def _judge(
    run: Run, arm: RobotArm, search: Search, polish: max_min.Polish | None = None
) -> Candidate:
    """Measure the posture that a start led to, moved to within the limits or one turn."""
    point = run.solution.variables[: arm.size]
    merit = sigma = float("nan")
    polished: bool | None = None
    if np.all(np.abs(point) <= LARGEST):
        lower, upper = arm.bounds
        endless = ~np.isfinite(lower) & ~np.isfinite(upper) & ~np.array(arm.chain.prismatic)
        turned = np.where(endless, (point + np.pi) % (2 * np.pi) - np.pi, point)
        point = np.clip(turned, lower, upper)
        if polish is not None:
            point, polished = _better(arm, search.locked, point, polish)
        matrix = arm.jacobian(point)
        if not arm.holds(point):
            pass
        elif search.failures is not None:
            merit = unequal_max_min.merit(matrix, search.failures, search.goal)
        else:
            merit = catalogue.formulation(search.formulation).merit(matrix, search.locked)
        sigma = measures.worst_case_sigma(matrix, search.locked)
    merit = merit if np.isfinite(merit) else float("nan")
    return Candidate(run.solution.status.return_status, merit, sigma, point, polished)


def _better(
    arm: RobotArm, locked: int, point: FloatArray, polish: max_min.Polish
) -> tuple[FloatArray, bool]:
    """Return the polished point if it is not worse, and whether that converged."""
    found, converged = polish(point)
    before, after = (
        measures.worst_case_sigma(arm.jacobian(one), locked) for one in (point, found)
    )
    return (found, converged) if after >= before * (1 - _SAME) else (point, False)
