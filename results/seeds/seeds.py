"""Whether six searches from other random starts end at the same best posture of an arm.

A posture is a configuration of the joints; it is the better the larger its worst-case σ is, the
smallest singular value of the Jacobian after the worst single joint locks. The search for it is
not exact: it makes random starts until its stopping rule holds. What comes in: the arms of
results/robots and of ``others.csv``. What goes out: ``seeds.csv``, a `SeedRow` for each arm.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from lockedjoint.formulations.io.table import HIDDEN, column, read_rows
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.search import Search
from results.robots.survey import ARMS, SurveyArm
from results.script import main, study_of

# The number of searches of each arm. More of them find disagreement more surely.
_SEEDS = 6
# Two searches have found the same if their σ differ by this share of the best at most. It is
# above the tolerance of the solver; a smaller share counts rounding as another posture.
_SAME_SHARE = 1e-4
#: Arms on which the stopping rule was not tried while it was made.
OTHERS = tuple(read_rows(Path(__file__).with_name("others.csv"), SurveyArm))


@dataclass(frozen=True)
class SeedRow:
    """One arm: the columns of ``seeds.csv``.

    On some arms of the `group` survey the stopping rule was tried while it was made. `agree` of
    the seeds found the largest worst-case σ of all, within 0.01 %; the `shortfall` is that of
    the seed that found the least, in percent. The rule held for `settled` seeds before the
    largest number of starts. `optima` counts the different scores at which starts ended, the
    most of all seeds.
    """

    arm: str
    task: str
    group: str = field(metadata=HIDDEN)
    joints: int
    best: float = field(metadata=column("best σ", ".6f"))
    agree: int = field(metadata=column(f"seeds of {_SEEDS} that found it"))
    shortfall: float = field(metadata=column("least, % below", ".2g"))
    settled: int = field(metadata=column("rule held"))
    least_starts: int = field(metadata=column("fewest starts"))
    most_starts: int = field(metadata=column("most starts"))
    optima: int = field(metadata=column("optima seen"))


def compute(effort: Effort, folder: Path) -> Iterator[SeedRow]:  # noqa: ARG001
    """Yield a row for each arm without a structural failure; arms with one are not searched."""
    arms = [(robot, robot.arm()) for robot in chain(OTHERS, ARMS)]
    search = Search(starts=effort.starts, workers=effort.workers, progress=effort.bars)
    for robot, arm in arms:
        found = []
        for seed in range(effort.seed, effort.seed + _SEEDS):
            effort.progress(f"{robot.name}, {robot.task}, seed {seed}")
            found.append(best_posture(arm, replace(search, seed=seed)))
            if not found[-1].complete:
                raise KeyboardInterrupt  # the user ended the search: the study ends, too
            if not found[-1].starts:  # a failure is fatal at every posture: no search is made
                break
        else:
            scores = [posture.assessment.worst_case_sigma for posture in found]
            best = max(scores)
            starts = [posture.starts for posture in found]
            yield SeedRow(
                arm=robot.name,
                task=robot.task,
                group="survey" if robot in ARMS else "others",
                joints=arm.shape[1],
                best=best,
                agree=sum(score >= (1 - _SAME_SHARE) * best for score in scores),
                shortfall=100 * (1 - min(scores) / best),
                settled=sum(posture.settled for posture in found),
                least_starts=min(starts),
                most_starts=max(starts),
                optima=max(posture.optima for posture in found),
            )


STUDY = study_of(
    __file__,
    compute,
    SeedRow,
    title="the same best posture from six seeds",
    takes="ten minutes, and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
