"""What recovers arms that exist from failures, and what is known to be impossible."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from formulations.io.study import Effort, write_json
from formulations.io.table import HIDDEN, column
from formulations.recovery.answers import Impossible, Recovered
from formulations.recovery.recover import recover
from results.recovery.peers import by_one_solution, by_pink
from results.recovery.tasks import FAILURES, GOALS, NAMES, arm_named, draw, stated
from results.script import main, study_of

#: The halves of the tasks, by their seeds: nothing was tried out on the one held back.
HALVES = {"tuning": 12345, "held back": 54321}
# Tasks of each arm, kind of failures and of goal, in a half.
_EACH = 1


@dataclass(frozen=True)
class RecoveryRow:
    """One way of recovery on the tasks of one kind: the columns of ``recovery.csv``.

    Of the tasks in a half, with failures and goals of a kind: solved with a trajectory,
    proved to be impossible, or unknown. The share is of those that are not proved impossible by
    ours. Seconds are of the processor, of one task.
    """

    half: str
    failures: str
    goal: str
    method: str
    tasks: int
    solved: int
    proved: int = field(metadata=column("proved impossible"))
    unknown: int
    share: float = field(metadata=column("% of what may be possible", ".0f"))
    median_seconds: float = field(metadata=column("median CPU (s)", ".2f"))
    largest_seconds: float = field(metadata=column("largest (s)", ".1f"))
    arms: int = field(metadata=HIDDEN)


def _ours(task: dict[str, Any]) -> str:
    robot, start, failures, goal = stated(task)
    arm = arm_named(task["arm"])
    answer = recover(robot, start, failures, goal, tip=arm.tip, base=arm.base or None)
    if isinstance(answer, Recovered):
        return "solved"
    return "proved" if isinstance(answer, Impossible) else "unknown"


def _other(way: Callable[[dict[str, Any]], bool]) -> Callable[[dict[str, Any]], str]:
    return lambda task: "solved" if way(task) else "unknown"


METHODS: dict[str, Callable[[dict[str, Any]], str]] = {
    "recover": _ours,
    "RRT-Connect to one solution": _other(by_one_solution),
    "pink": _other(by_pink),
}


def compute(effort: Effort, folder: Path) -> Iterator[RecoveryRow]:
    """Yield three rows for each half, kind of failures and kind of goal; write the tasks."""
    answers: dict[str, dict[str, list[Any]]] = {}
    for half, seed in HALVES.items():
        tasks = list(draw(effort.starts or _EACH, seed + effort.seed))
        name = f"tasks_{half.replace(' ', '_')}.json"
        write_json(folder / name, {"seed": seed + effort.seed, "tasks": tasks})
        tasks = json.loads((folder / name).read_text(encoding="utf-8"))["tasks"]
        answers[half] = {}
        for kind in ([failure, goal] for failure in FAILURES for goal in GOALS):
            own = [task for task in tasks if task["kind"] == kind]
            effort.progress(f"{half}, {' and '.join(kind)}")
            results = {method: list(map(_timed(way), own)) for method, way in METHODS.items()}
            answers[half][", ".join(kind)] = [
                [task["id"], *(words for words, _ in given)]
                for task, *given in zip(own, *results.values(), strict=True)
            ]
            write_json(folder / "answers.json", {"methods": list(METHODS), **answers})
            proved = sum(words == "proved" for words, _ in results["recover"])
            for method, given in results.items():
                yield _row((half, kind[0], kind[1], method), given, proved)


def _timed(
    way: Callable[[dict[str, Any]], str],
) -> Callable[[dict[str, Any]], tuple[str, float]]:
    def run(task: dict[str, Any]) -> tuple[str, float]:
        started = time.process_time()
        words = way(task)
        return words, time.process_time() - started

    return run


def _row(
    titles: tuple[str, str, str, str], given: list[tuple[str, float]], impossible: int
) -> RecoveryRow:
    words, seconds = [each for each, _ in given], [cpu for _, cpu in given]
    solved, proved = words.count("solved"), words.count("proved")
    return RecoveryRow(
        *titles,
        tasks=len(given),
        solved=solved,
        proved=proved,
        unknown=len(given) - solved - proved,
        share=100 * solved / max(1, len(given) - impossible),
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
