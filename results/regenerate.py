"""All results, or those of some studies, computed anew, and the page in front of them.

    python results/regenerate.py [STUDY …] [--all] [--starts K] [--seed S] [--out FOLDER]

Each study writes into the folder of its name in `results/` (or FOLDER): CSV tables, a page, and
files of its own. The front page, ``README.md``, is written from these tables after each study.
A new study is a folder with a script, whose `STUDY` is listed in `STUDIES` here.
"""

import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from lockedjoint.commands.output import INTERRUPTED
from lockedjoint.formulations.comparison import ComparisonRow
from lockedjoint.formulations.io.files import write_text
from results.atlas import atlas
from results.basin_hopping import basin_hopping
from results.benchmark import benchmark
from results.bounds import bounds
from results.comparison import comparison
from results.comparison_8r import comparison_8r
from results.demonstration import demonstration
from results.existence import existence
from results.failures import failures
from results.figures import figures
from results.fuzz import fuzz
from results.guaranteed import guaranteed
from results.inverse_kinematics import inverse_kinematics
from results.optimisers import optimisers
from results.pages import page
from results.paths import paths
from results.recovery import recovery
from results.relaxation import relaxation
from results.reproduction import reproduction
from results.robots import robots
from results.robots_public import robots_public
from results.script import parser, run
from results.second_search import second_search
from results.seeds import seeds
from results.speed import speed
from results.study import Rows, Study
from results.workspaces import workspaces

RESULTS = Path(__file__).parent
TEMPLATE = RESULTS / "README.md.j2"
#: In the order in which they run: where a new one is listed.
STUDIES: Mapping[str, Study] = {
    study.name: study
    for study in (
        reproduction.STUDY,
        comparison.STUDY,
        comparison_8r.STUDY,
        existence.STUDY,
        relaxation.STUDY,
        bounds.STUDY,
        failures.STUDY,
        figures.STUDY,
        robots.STUDY,
        robots_public.STUDY,
        seeds.STUDY,
        paths.STUDY,
        recovery.STUDY,
        inverse_kinematics.STUDY,
        demonstration.STUDY,
        workspaces.STUDY,
        guaranteed.STUDY,
        atlas.STUDY,
        second_search.STUDY,
        basin_hopping.STUDY,
        optimisers.STUDY,
        fuzz.STUDY,
        benchmark.study(),
        speed.STUDY,
    )
}
# Figures that show what a study found, by the study's name.
_PICTURES: Mapping[str, tuple[str, ...]] = {
    "reproduction": ("figure-1", "figure-3"),
    "comparison": ("trade-off", "optima"),
    "bounds": ("singular-values",),
    "figures": ("seven-axes",),
}


def front_page(out: Path, seed: int) -> str:
    """Return the page in front of the studies' folders in `out` as Markdown."""
    findings = {k: study.finding(study.read(out / k)) for k, study in STUDIES.items()}
    pictures = {
        name: [file for file in files if (out / "figures" / f"{file}.svg").exists()]
        for name, files in _PICTURES.items()
    }
    shown = {"studies": STUDIES.values(), "findings": findings, "pictures": pictures}
    return page(TEMPLATE, {**values(read_all(out)), **shown, "seed": seed})


def read_all(out: Path) -> Rows:
    """Return the rows of all studies in a folder; tables of one name are joined."""
    joined: dict[str, list[Any]] = {}
    for study in STUDIES.values():
        for stem, rows in study.read(out / study.name).items():
            joined.setdefault(stem, []).extend(rows)
    return joined


def plain(
    rows: Sequence[ComparisonRow], formulation: str, model: str, joints: int
) -> ComparisonRow | None:
    """Return the comparison's row without a variant, if it is there."""
    wanted = (formulation, model, joints, "")
    same = (r for r in rows if (r.formulation, r.model, r.joints, r.variant) == wanted)
    return next(same, None)


def values(tables: Rows) -> dict[str, Any]:
    """Return what the template of the front page needs besides findings and pictures."""
    own = partial(plain, tables["comparison"])
    return {**tables, "plain": own, "of_quantity": bounds.of_quantity}


def main() -> int:
    """Run what the command line asks for; a study that fails does not stop the others."""
    words = "Compute the results anew: what is quick, all, or what is named."
    made = parser(words, RESULTS)
    made.add_argument("studies", nargs="*", metavar="STUDY", help=", ".join(STUDIES))
    made.add_argument("--all", action="store_true", help="all of them, also the benchmark")
    options = made.parse_args()
    unknown = sorted(set(options.studies) - set(STUDIES))
    if unknown:
        made.error(f"no study is called {unknown[0]}; allowed: {', '.join(STUDIES)}")
    usual = [name for name, study in STUDIES.items() if options.all or not study.long]
    status = 0
    for name in options.studies or usual:
        status = max(status, run(STUDIES[name], options, options.out / name))
        if status == INTERRUPTED:
            break
        write_text(options.out / "README.md", front_page(options.out, options.seed))
    return status


if __name__ == "__main__":
    sys.exit(main())
