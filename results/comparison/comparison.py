"""The formulations from common starts, for seven joints: its table and its page.

A formulation is a way to state what a good Jacobian, shape (6, n), of n joints is: an
optimisation problem. All are solved from the same random starts, and each answer is measured in
the same ways. Out come ``comparison.csv``, a `ComparisonRow` for each case of
`lockedjoint.formulations.comparison`, and ``jacobians.json``, the best Jacobian of each.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from lockedjoint.formulations.comparison import ComparisonRow, cases, compare_cases
from lockedjoint.formulations.io.files import write_json
from lockedjoint.formulations.solving.effort import Effort
from results.script import main, study_of
from results.study import Study

#: Rows of a Jacobian: three of linear and three of angular velocity.
TASK_DIMENSION = 6


def compute(joints: int, effort: Effort, folder: Path) -> Iterator[ComparisonRow]:
    """Compute the rows for so many joints; the best Jacobians go into a file of their own."""
    jacobians = []
    for compared in compare_cases(cases(joints, TASK_DIMENSION), effort):
        jacobians.append(compared.jacobian())
        write_json(folder / "jacobians.json", jacobians)
        yield compared.row


def study(joints: int, file: str) -> Study:
    """Return the comparison of so many joints as the study of a script."""
    return study_of(
        file,
        partial(compute, joints),
        page="comparison.md",
        template=Path(__file__).with_suffix(".md.j2"),
        tables={"comparison": ComparisonRow},
        title=f"the three formulations on {joints}R, from common starts",
        takes="under a minute",
    )


STUDY = study(7, __file__)

if __name__ == "__main__":
    main(STUDY, __file__)
