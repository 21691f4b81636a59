"""Failures that a simulated arm notices and recovers from, along two trajectories of a path."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from formulations.io.files import write_bytes
from formulations.io.study import Effort, write_json
from formulations.kinematics.forward import Kinematics
from formulations.paths.search import PathSearch, plan_path
from nlp.arrays import FloatArray
from nlp.executors import LocalExecutor
from results.paths.paths import PATHS
from results.script import main, study_of

# The path of results/paths, the seconds that it takes, and failures along each trajectory.
[_PATH] = [each for each in PATHS if (each.arm, each.path) == ("Franka Panda", "tilting")]
_SECONDS, _FAILURES = 6.0, 200
# A path is finished if the tool ends this near to its end, metres.
_NEAR = 5e-3


@dataclass(frozen=True)
class EpisodeRow:
    """A failure along a trajectory: the columns of ``demonstration.csv``.

    The outcome is *finished*, *lost* if the tool did not get to the end of the path though it
    was to, or the verdict of `recover`. Seconds are from the start to the failure, from there
    until it is noticed, NaN if it is not, and of the processor for `recover`. Distances of the
    tool from the path are in millimetres: the largest until the arm stands, on the way back to
    the path, and from then on, with the root of the mean square.
    """

    trajectory: str
    number: int
    joint: int
    fails_at: float
    outcome: str
    noticed_after: float
    recover_seconds: float
    until_standing: float
    way_back: float
    going_on: float
    going_on_rms: float

    @property
    def reaction(self) -> float:
        """Seconds from the failure until there is an answer."""
        return self.noticed_after + self.recover_seconds


def episode_row(
    name: str, samples: FloatArray, number: int, joint: int, moment: float
) -> EpisodeRow:
    """Return what the failure of a joint at a moment comes to."""
    from results.demonstration.episode import play
    from results.demonstration.simulated_arm import STEP

    arm, path = _PATH.stated()
    made = play(_PATH, _SECONDS, samples, joint, moment)
    tool = Kinematics(arm.chain).forward(made.joints.T, jacobian=False)[0].T
    off = 1e3 * cKDTree(path.sampled(20_000, 1.0)[1].positions).query(tool)[0]
    fails, noticed, stands, back, end = made.ends
    unnoticed, outcome = made.verdict == "unnoticed", made.verdict
    if outcome in ("trajectory", "unnoticed"):
        near = np.linalg.norm(tool[-1] - path.positions[-1]) < _NEAR
        outcome = "finished" if near else "lost"
    later = off[back:] if end > back else np.array([np.nan])
    return EpisodeRow(
        *(name, number, joint + 1, moment, outcome),
        noticed_after=np.nan if unnoticed else round(STEP * (noticed - fails), 3),
        recover_seconds=round(made.recover_seconds, 3),
        until_standing=round(float(np.max(off[:stands])), 2),
        way_back=round(float(np.max(off[stands:back], initial=0.0)), 2),
        going_on=round(float(np.max(later)), 2),
        going_on_rms=round(float(np.sqrt(np.mean(later**2))), 2),
    )


def compute(effort: Effort, folder: Path) -> Iterator[EpisodeRow]:
    """Yield a row for each failure; write the trajectories, and an animation of one failure.

    It is the first, in the first half of the path, that is proved to leave no way along the
    minimum-norm trajectory, and that the planned one survives.
    """
    # Only where it is run: MuJoCo is nothing that other studies need.
    from results.demonstration.animation import animated
    from results.demonstration.episode import play
    from results.demonstration.simulated_arm import SimulatedArm

    plan = plan_path(*_PATH.stated(), PathSearch(duration=_SECONDS, seed=effort.seed))
    ways = {"minimum norm": plan.minimum_norm, "planned": plan.planned}
    tracks = {name: np.round(way.configurations, 7) for name, way in ways.items() if way}
    write_json(folder / "trajectories.json", {name: q.tolist() for name, q in tracks.items()})
    rng, count = np.random.default_rng(effort.seed), effort.starts or _FAILURES
    moments = np.round(rng.uniform(0.0, _SECONDS - 0.001, count), 3).tolist()
    joints = rng.integers(len(plan.joints), size=count).tolist()
    failures = list(zip(range(1, count + 1), joints, moments, strict=True))
    rows: list[EpisodeRow] = []
    with LocalExecutor(effort.workers) as executor:
        every = [(name, q, *failure) for failure in failures for name, q in tracks.items()]
        for job in [executor.submit(episode_row, *each) for each in every]:
            effort.progress(f"failure {len(rows) // 2 + 1} of {count}")
            rows.append(job.result())
            yield rows[-1]
    for row, other in zip(rows[::2], rows[1::2], strict=True):
        early, outcomes = row.fails_at < _SECONDS / 2, (row.outcome, other.outcome)
        if early and outcomes == ("impossible, proved", "finished"):
            failure = row.joint - 1, row.fails_at
            made = {name: play(_PATH, _SECONDS, q, *failure) for name, q in tracks.items()}
            picture = animated(SimulatedArm(_PATH.robot), tracks["planned"], failure[0], made)
            write_bytes(folder / "demonstration.webp", picture)
            break


STUDY = study_of(
    __file__,
    compute,
    EpisodeRow,
    title="failures of a simulated arm, noticed and recovered from",
    takes="ten minutes, mujoco and packages of robots",
    long=True,
    settings={"quantile": np.quantile},
)

if __name__ == "__main__":
    main(STUDY, __file__)
