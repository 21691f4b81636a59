"""Read the file path.json, which `path` writes."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from lockedjoint.formulations.io.files import load_json, read_bytes
from lockedjoint.kinematics.chain import LARGEST
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import FileError, as_path
from lockedjoint.paths.plan_in_time import PlanInTime, check_followed
from lockedjoint.paths.waypoints import at_waypoints

# A timed plan has these tables, a row a time.
_STATES = ("positions", "velocities", "accelerations")


def read_plan(file: str | os.PathLike[str]) -> PlanInTime:
    """Read the path.json that `path --out-dir` writes.

    Its times are those of trajectory.csv if the plan is timed (`--acceleration`), and otherwise
    those of path.csv.

    Raises
    ------
    InputError
        If it cannot be read, is no such file, or keeps only some directions of the tool.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> try:
    ...     lj.read_plan("nowhere/path.json")
    ... except lj.InputError as error:
    ...     print(error)
    plan is nowhere/path.json; allowed: a file that can be read (no such file or directory).
    """
    path = as_path("plan", file)
    values = load_json(read_bytes(path, "plan"), path)
    try:
        plan, task = _plan(values), TaskSpace(tuple(values["task"]))
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise FileError("plan", str(path), "the path.json that `path` writes") from None
    check_followed(task.rows)
    return plan


def _plan(values: Any) -> PlanInTime:
    """Return the plan of a file; an error of any kind if something is not as it has to be."""
    joints = tuple(str(row["joint"]) for row in values["joints"])
    waypoints, samples = _numbers(values["waypoints"]), _numbers(values["places"])
    at_samples = _numbers(values["trajectory"]["configurations"])
    run = values["timed"]
    if run is None:
        clock, times, places, states = (
            "path.csv",
            _numbers(values["times"]),
            samples,
            [at_samples],
        )
    else:
        clock, times, places = "trajectory.csv", _numbers(run["times"]), _numbers(run["places"])
        states = [_numbers(run[name]) for name in _STATES]
    count, width = waypoints.shape
    chosen = at_waypoints(samples)
    fits = (
        width in (3, 7)
        and np.round(samples[chosen]).tolist() == list(range(1, count + 1))
        and at_samples.shape == (len(samples), len(joints))
        and places.shape == times.shape
        and all(state.shape == (len(times), len(joints)) for state in states)
        and np.all(np.diff(times) > 0)
        and np.all(np.diff(places) >= 0)
        and len(times) > 1 < count
        and 1 <= places[0] <= places[-1] <= count
        and len(set(joints)) == len(joints)
    )
    if not fits:
        raise ValueError
    locked = {str(name): float(_numbers(at)) for name, at in values["locked"].items()}
    return PlanInTime(
        joints,
        waypoints[:, :3],
        waypoints[:, 3:] if width == 7 else None,
        at_samples[chosen],
        times,
        np.stack(states),
        places,
        clock,
        locked,
    )


def _numbers(given: Any) -> FloatArray:
    """Return an array of finite numbers; ValueError otherwise."""
    array = as_floats("plan", given)
    if not np.all(np.abs(array) <= LARGEST):
        raise ValueError
    return array
