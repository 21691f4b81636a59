"""Failures that a simulated arm notices and recovers from, along two trajectories of a path.

A path of the Panda's tool is run along two trajectories: that of minimum norm, and the planned
one, which is chosen so that joints may lock. Along each, joints lock at random moments, the
same for both; `simulated_arm` says what happens then. What goes out:

- ``demonstration.csv``: a `TrajectoryRow` for each trajectory;
- ``failures.csv``: a line for each failure, with the keys of `failure_of`;
- ``trajectories.json``: configurations along both, radians, by the trajectory's name;
- ``demonstration.webp``: an animation of one failure, side by side.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from lockedjoint.formulations.io.escaping import rows_csv
from lockedjoint.formulations.io.files import write_bytes, write_json, write_text
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.executors import LocalExecutor
from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.search import plan_path
from results.paths.paths import PATHS
from results.script import main, study_of

# The path, one of results/paths.
[_PATH] = [each for each in PATHS if (each.arm, each.path) == ("Franka Panda", "tilting")]
# Seconds that the path takes. If they are fewer, the arm is faster, and goes
# farther until it stands.
_SECONDS = 6.0
# The last failure is this much before the end, or earlier: later ones would not be in time.
_BEFORE_END_S = 0.001
# The number of failures along each trajectory. More of them make the shares more certain.
_FAILURES = 200
# A path is finished if the tool ends this near to its end. A smaller limit also calls paths
# lost that the controller follows with its usual error.
_NEAR_M = 5e-3
# The number of points on the path to which the tool's distance is taken: with fewer of them
# the distance is too large.
_PATH_POINTS = 20_000
# The number of decimals of the stored configurations, radians.
_DECIMALS = 7


@dataclass(frozen=True)
class TrajectoryRow:
    """What the failures along a trajectory came to: the columns of ``demonstration.csv``.

    Outcomes are counted: *finished*, *lost* if the tool did not get to the end of the path
    though it was to, or the verdict of `recover`. Of seconds the median and what 95 % stay
    below: until a failure is noticed, of the processor for `recover`, and both. Of the tool's
    distance from the path, in millimetres, the median and the largest: until the arm stands, on
    the way back to the path, and from then on, with the root of the mean square.
    """

    trajectory: str
    failures: int
    unnoticed: int
    outcomes: Mapping[Any, int]
    seconds: Mapping[Any, Sequence[float]]
    distances: Mapping[Any, Sequence[float]]


def failure_of(
    name: str, samples: FloatArray, number: int, joint: int, moment: float
) -> dict[str, Any]:
    """Return what the failure of a joint at a moment comes to: a line of ``failures.csv``.

    Parameters
    ----------
    name, samples
        The trajectory's name, and its configurations at samples of the path, shape (K, n),
        radians.
    number
        The failure's number, from 1.
    joint
        The joint that locks, from 0; in the line from 1.
    moment
        When it locks, in seconds.

    Returns
    -------
    dict
        The numbers above, ``outcome`` as in `TrajectoryRow`; seconds ``noticed_after`` the
        failure and of the processor for `recover`; the tool's largest distance from the path in
        millimetres ``until_standing``, on the ``way_back`` and ``going_on`` from there, and of
        the last the root of the mean square. NaN stands for what there was not.
    """
    from results.demonstration.simulated_arm import STEP, play

    arm, path = _PATH.stated()
    made = play(_PATH, _SECONDS, samples, joint, moment)
    tool = arm.chain.tip_at(made.joints.T)[0].T
    off = 1e3 * cKDTree(path.sampled(_PATH_POINTS, 1.0)[1].positions).query(tool)[0]
    fails, noticed, stands, back, end = made.ends
    unnoticed, outcome = made.verdict == "unnoticed", made.verdict
    if outcome in ("trajectory", "unnoticed"):
        near = np.linalg.norm(tool[-1] - path.positions[-1]) < _NEAR_M
        outcome = "finished" if near else "lost"
    later = off[back:] if end > back else np.array([np.nan])
    return {
        **{"trajectory": name, "number": number, "joint": joint + 1, "fails_at": moment},
        "outcome": outcome,
        "noticed_after": np.nan if unnoticed else round(STEP * (noticed - fails), 3),
        "recover_seconds": round(made.recover_seconds, 3),
        "until_standing": round(np.max(off[:stands]), 2),
        "way_back": round(np.max(off[stands:back], initial=0.0), 2) if end > back else np.nan,
        "going_on": round(np.max(later), 2),
        "going_on_rms": round(np.sqrt(np.mean(later**2)), 2),
    }


def row_of(name: str, failures: pd.DataFrame) -> TrajectoryRow:
    """Return what the failures along a trajectory came to, in sum."""
    seconds = failures[["noticed_after", "recover_seconds"]]
    seconds = seconds.assign(both=seconds.sum(axis=1, skipna=False)).quantile([0.5, 0.95])
    off = failures[["until_standing", "way_back", "going_on", "going_on_rms"]]
    return TrajectoryRow(
        trajectory=name,
        failures=len(failures),
        unnoticed=int(failures.noticed_after.isna().sum()),
        outcomes=failures.outcome.value_counts().to_dict(),
        seconds=seconds.round(3).to_dict("list"),
        distances=off.agg(["median", "max"]).to_dict("list"),
    )


def compute(effort: Effort, folder: Path) -> Iterator[TrajectoryRow]:
    """Yield a row for each trajectory; write these, all failures, and an animation of one.

    The animation is of the first failure in the first half of the path that is proved to leave
    no way along the minimum-norm trajectory, and that the planned one survives.
    """
    # MuJoCo is imported only where it is run: other studies do not need it.
    from results.demonstration.animation import animated
    from results.demonstration.simulated_arm import SimulatedArm, play

    plan = plan_path(*_PATH.stated(), PathSearch(duration=_SECONDS, seed=effort.seed))
    ways = {"minimum norm": plan.minimum_norm, "planned": plan.planned}
    tracks = {
        name: np.round(way.configurations, _DECIMALS) for name, way in ways.items() if way
    }
    write_json(folder / "trajectories.json", {name: q.tolist() for name, q in tracks.items()})
    rng, count = np.random.default_rng(effort.seed), effort.starts or _FAILURES
    moments = np.round(rng.uniform(0.0, _SECONDS - _BEFORE_END_S, count), 3).tolist()
    joints = rng.integers(len(plan.joints), size=count).tolist()
    drawn = zip(range(1, count + 1), joints, moments, strict=True)
    every = [(name, q, *failure) for failure in drawn for name, q in tracks.items()]
    ends: list[dict[str, Any]] = []
    with LocalExecutor(effort.workers) as executor:
        for job in [executor.submit(failure_of, *each) for each in every]:
            effort.progress(f"failure {len(ends) // 2 + 1} of {count}")
            ends.append(job.result())
    failures = pd.DataFrame(ends)
    write_text(folder / "failures.csv", rows_csv(ends))
    for name in tracks:
        yield row_of(name, failures[failures.trajectory == name])
    for end, other in zip(ends[::2], ends[1::2], strict=True):
        early, outcomes = end["fails_at"] < _SECONDS / 2, (end["outcome"], other["outcome"])
        if early and outcomes == ("impossible, proved", "finished"):
            failure = end["joint"] - 1, end["fails_at"]
            made = {name: play(_PATH, _SECONDS, q, *failure) for name, q in tracks.items()}
            picture = animated(SimulatedArm(_PATH.robot), tracks["planned"], failure[0], made)
            write_bytes(folder / "demonstration.webp", picture)
            break


STUDY = study_of(
    __file__,
    compute,
    TrajectoryRow,
    title="failures of a simulated arm, noticed and recovered from",
    takes="two minutes, mujoco and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
