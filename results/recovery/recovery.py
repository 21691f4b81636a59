"""What recovers arms that exist from failures, and what is known to be impossible."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from formulations.io.files import write_text
from formulations.io.study import Effort
from formulations.io.table import HIDDEN, column
from formulations.recovery.recover import recover
from results.recovery.peers import by_one_solution, by_pink
from results.recovery.tasks import KINDS, NAMES, draw, stated
from results.script import main, study_of

#: The halves of the tasks, by their seeds; the one held back is for the end.
HALVES = {"tuning": 12345, "held back": 54321}
# Tasks of each arm, kind of failures and of goal, in a half.
_EACH = 39


@dataclass(frozen=True)
class RecoveryRow:
    """Tasks with failures and goals of a kind, of both halves: the columns of ``recovery.csv``.

    By `recover` solved with a trajectory, impossible, proved or numerical, or unknown. The
    share is of those that are not known to be impossible. Seconds are of the processor, of one
    task.
    """

    failures: str
    goal: str
    tasks: int
    solved: int
    proved: int = field(metadata=column("proved impossible"))
    numerical: int = field(metadata=column("impossible, numerical"))
    unknown: int
    share: float = field(metadata=column("% of what may be possible", ".0f"))
    median_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    largest_seconds: float = field(metadata=column("largest (s)", ".1f"))
    one_solution: int = field(metadata=column("RRT-Connect to one solution"))
    one_solution_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    pink: int
    pink_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    held_back_solved: int = field(metadata=HIDDEN)
    held_back_impossible: int = field(metadata=HIDDEN)
    held_back_unknown: int = field(metadata=HIDDEN)
    arms: int = field(metadata=HIDDEN)


def _ours(task: dict[str, Any]) -> str:
    arm, start, goal, clearance = stated(task)
    tip, base = arm.chain.tip, arm.chain.base
    answer = recover(
        arm.tree, start, arm.failures, goal, tip=tip, base=base, clearance=clearance
    )
    return _WORDS[answer.verdict]


# Of `recover`, what its verdicts count as.
_WORDS = {
    "trajectory": "solved",
    "impossible, proved": "proved",
    "impossible, numerical": "numerical",
    "not found": "unknown",
}
METHODS: dict[str, Callable[[dict[str, Any]], str]] = {
    "recover": _ours,
    "RRT-Connect to one solution": by_one_solution,
    "pink": by_pink,
}
# Half, number of the task, method, answer and seconds.
_Answer: TypeAlias = tuple[str, int, str, str, float]


def compute(effort: Effort, folder: Path) -> Iterator[RecoveryRow]:
    """Yield a row for each kind of failures and kind of goal; write the tasks and answers."""
    tasks = {}
    for half, seed in HALVES.items():
        tasks[half] = list(draw(effort.starts or _EACH, seed + effort.seed))
        lines = ",\n".join(json.dumps(task) for task in tasks[half])
        write_text(folder / f"tasks_{half.replace(' ', '_')}.json", f"[\n{lines}\n]\n")
    lines = "half,id,method,answer,seconds\n"
    for kind in KINDS:
        effort.progress(" and ".join(kind))
        answers = [
            _answered(half, task, method)
            for half, own in tasks.items()
            for task in own
            if tuple(task["kind"]) == kind
            for method in METHODS
        ]
        lines += "".join(",".join(map(str, answer)) + "\n" for answer in answers)
        write_text(folder / "answers.csv", lines)
        yield _row(*kind, answers)


def _answered(half: str, task: dict[str, Any], method: str) -> _Answer:
    started = time.process_time()
    answer = METHODS[method](task)
    return half, task["id"], method, answer, round(time.process_time() - started, 3)


def _row(failures: str, goal: str, answers: list[_Answer]) -> RecoveryRow:
    ours, others, pink = (
        [answer for answer in answers if answer[2] == method] for method in METHODS
    )
    words = [answer[3] for answer in ours]
    held_back = [answer[3] for answer in ours if answer[0] == "held back"]
    impossible = [part.count("proved") + part.count("numerical") for part in (words, held_back)]
    possible = len(words) - impossible[0]
    return RecoveryRow(
        *(failures, goal, len(ours)),
        solved=words.count("solved"),
        proved=words.count("proved"),
        numerical=words.count("numerical"),
        unknown=words.count("unknown"),
        share=100 * words.count("solved") / possible if possible else np.nan,
        median_seconds=_median(ours),
        largest_seconds=max(answer[4] for answer in ours),
        one_solution=sum(answer[3] == "solved" for answer in others),
        one_solution_seconds=_median(others),
        pink=sum(answer[3] == "solved" for answer in pink),
        pink_seconds=_median(pink),
        held_back_solved=held_back.count("solved"),
        held_back_impossible=impossible[1],
        held_back_unknown=held_back.count("unknown"),
        arms=len(NAMES),
    )


def _median(answers: list[_Answer]) -> float:
    return float(np.median([answer[4] for answer in answers]))


STUDY = study_of(
    __file__,
    compute,
    RecoveryRow,
    title="recoveries from failures, and what is impossible",
    takes="two hours, and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
