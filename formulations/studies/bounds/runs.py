"""The bounds that the study of bounds computes, by the name of the file each goes to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from formulations.studies.study import Effort


@dataclass(frozen=True)
class BoundRun:
    """A bound to be computed.

    Attributes
    ----------
    file
        Where it goes.
    compute
        Returns what ``lockedjoint bound --json`` prints.
    """

    file: str
    compute: Callable[[Effort], Mapping[str, Any]]


def _eq_6(_: Effort) -> Mapping[str, Any]:
    from formulations.bounds.worst_case.problem import free_columns
    from formulations.bounds.worst_case.program import solve_worst_case

    return solve_worst_case(free_columns(7, 6)).to_dict()


def _lever_arm(_: Effort) -> Mapping[str, Any]:
    from formulations.bounds.worst_case.problem import revolute_arm
    from formulations.bounds.worst_case.program import solve_worst_case

    return solve_worst_case(revolute_arm(7, lever_arm=1.0)).to_dict()


def _existence(order: int) -> Callable[[Effort], Mapping[str, Any]]:
    def compute(_: Effort) -> Mapping[str, Any]:
        from formulations.existence.relaxation.relaxation import existence_relaxation

        return existence_relaxation(order, 7, task_dimension=6).to_dict()

    return compute


def _residual(preset: str, rigorous: bool = False) -> Callable[[Effort], Mapping[str, Any]]:
    def compute(effort: Effort) -> Mapping[str, Any]:
        from formulations.bounds.so3_moments.residual_bound import residual_bound
        from formulations.bounds.so3_moments.rigorous_residual import rigorous_residual_bound

        bound = rigorous_residual_bound if rigorous else residual_bound
        return bound(preset, 7, seed=effort.seed, progress=effort.progress).to_dict()

    return compute


def _max_min(preset: str, rigorous: bool = False) -> Callable[[Effort], Mapping[str, Any]]:
    def compute(effort: Effort) -> Mapping[str, Any]:
        from formulations.bounds.so3_moments.max_min_bound import max_min_bound

        found = max_min_bound(
            preset, 7, rigorous=rigorous, seed=effort.seed, progress=effort.progress
        )
        return found.to_dict()

    return compute


RUNS = (
    BoundRun("worst_case_7_6.json", _eq_6),
    BoundRun("worst_case_7r_lever_arm_1.json", _lever_arm),
    BoundRun("existence_order_2.json", _existence(2)),
    BoundRun("existence_order_3.json", _existence(3)),
    BoundRun("residual_fast.json", _residual("fast")),
    BoundRun("residual_compact.json", _residual("compact")),
    BoundRun("residual_tight.json", _residual("tight")),
    BoundRun("residual_compact_rigorous.json", _residual("compact", rigorous=True)),
    BoundRun("max_min_compact_rigorous.json", _max_min("compact", rigorous=True)),
    BoundRun("max_min_localised.json", _max_min("localised")),
)
