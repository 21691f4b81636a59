"""The atlas: every entry verified, a row for each, and a map of what is left to gain."""

from collections.abc import Iterator
from pathlib import Path

from formulations.atlas.collection import problem_of, read_atlas
from formulations.atlas.entry import AtlasRow, row_of
from formulations.io.files import write_bytes
from formulations.io.study import Effort
from formulations.max_min import NAME as MAX_MIN
from formulations.plot.style import content
from results.atlas.figure import gallery, heat_map
from results.script import main, study_of

_DRAWN = 8  # joints that an arm on the page has at most


def compute(effort: Effort, folder: Path) -> Iterator[AtlasRow]:
    """Yield a row for each entry, and draw the gaps and the arms."""
    gaps, arms = [], {}
    for page in read_atlas():
        effort.progress(page.entry.name)
        if problem := problem_of(page):
            raise ArithmeticError(f"{page.entry.name}: {problem}")
        row = row_of(page)
        if row.formulation == MAX_MIN:
            shape = row.task_dimension, row.joints
            gaps.append((row.model, *shape, row.locked, row.gap_percent))
            if row.joints <= _DRAWN and _is_arm(row):
                model = row.model.replace(",", ",\n")
                arms[f"{model}\n{shape[0]}×{shape[1]}, k = {row.locked}"] = page.jacobian
        yield row
    effort.progress("drawings")
    write_bytes(folder / "gaps.svg", content(heat_map(gaps), "svg"))
    write_bytes(folder / "arms.png", content(gallery(arms), "png"))


def _is_arm(row: AtlasRow) -> bool:
    """Whether the columns are those of joints: free ones in the plane and in space are."""
    return row.model != "free-mean" or row.task_dimension < 6


STUDY = study_of(
    __file__,
    title="the best Jacobian known of every kind of arm, beside the bounds",
    page="atlas.md",
    tables={"atlas": AtlasRow},
    takes="a minute",
    compute=compute,
)

if __name__ == "__main__":
    main(STUDY, __file__)
