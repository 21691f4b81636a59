"""What recovers arms that exist from failures, and what is known to be impossible."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from formulations.io.files import write_text
from formulations.io.study import Effort
from formulations.io.table import HIDDEN, column
from formulations.recovery.recover import recover
from results.recovery.peers import by_one_solution, by_pink
from results.recovery.tasks import KINDS, NAMES, draw, stated
from results.script import main, study_of

#: The halves of the tasks, by their seeds: nothing was tried out on the one held back.
HALVES = {"tuning": 12345, "held back": 54321}
# Tasks of each arm, kind of failures and of goal, in a half.
_EACH = 1


@dataclass(frozen=True)
class RecoveryRow:
    """One way of recovery on the tasks of one kind: the columns of ``recovery.csv``.

    Of the tasks in a half, with failures and goals of a kind: solved with a trajectory,
    impossible, proved or numerical, or unknown. The share is of those that are not known to be
    impossible. Seconds are of the processor, of one task.
    """

    half: str
    failures: str
    goal: str
    method: str
    tasks: int
    solved: int
    proved: int = field(metadata=column("proved impossible"))
    numerical: int = field(metadata=column("impossible, numerical"))
    unknown: int
    share: float = field(metadata=column("% of what may be possible", ".0f"))
    median_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    largest_seconds: float = field(metadata=column("largest (s)", ".1f"))
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


def compute(effort: Effort, folder: Path) -> Iterator[RecoveryRow]:
    """Yield three rows for each half, kind of failures and kind of goal; write the tasks."""
    answers = ["half,id,method,answer,seconds"]
    for half, seed in HALVES.items():
        tasks = list(draw(effort.starts or _EACH, seed + effort.seed))
        lines = ",\n".join(json.dumps(task) for task in tasks)
        write_text(folder / f"tasks_{half.replace(' ', '_')}.json", f"[\n{lines}\n]\n")
        for kind in KINDS:
            own = [task for task in tasks if tuple(task["kind"]) == kind]
            effort.progress(f"{half}, {' and '.join(kind)}")
            results: dict[str, list[tuple[str, float]]] = {method: [] for method in METHODS}
            for task in own:
                for method, way in METHODS.items():
                    started = time.process_time()
                    words = way(task)
                    seconds = time.process_time() - started
                    results[method].append((words, seconds))
                    answers.append(f"{half},{task['id']},{method},{words},{seconds:.3f}")
            write_text(folder / "answers.csv", "\n".join(answers) + "\n")
            ours = [word for word, _ in results["recover"]]
            impossible = ours.count("proved") + ours.count("numerical")
            for method, given in results.items():
                yield _row((half, *kind, method), given, impossible)


def _row(
    titles: tuple[str, ...], given: list[tuple[str, float]], impossible: int
) -> RecoveryRow:
    words, seconds = [each for each, _ in given], [cpu for _, cpu in given]
    half, failures, goal, method = titles
    return RecoveryRow(
        *(half, failures, goal, method),
        tasks=len(given),
        solved=words.count("solved"),
        proved=words.count("proved"),
        numerical=words.count("numerical"),
        unknown=words.count("unknown"),
        share=100 * words.count("solved") / max(1, len(given) - impossible),
        median_seconds=round(float(np.median(seconds)), 3),
        largest_seconds=round(max(seconds), 2),
        arms=len(NAMES),
    )


STUDY = study_of(
    __file__,
    compute,
    RecoveryRow,
    title="recoveries from failures, and what is impossible",
    takes="up to half an hour, and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
