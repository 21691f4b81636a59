"""How many inequivalent best Jacobians isolated entries have among twenty random starts.

    python results/atlas/inequivalent.py SECONDS

What comes in: the entries of the atlas whose Jacobian is isolated (`family` is 0) and was found
by random starts. Cheap entries come first, until so many seconds of processor time are over.
What goes out: the JSON file `INEQUIVALENT`, with two counts by the name of an entry: classes of
equivalent Jacobians among those that are as good as the entry's, its own included, and starts
that reached one. Two Jacobians are equivalent if they differ by the frame, the phase, the
mirror image, the order or the signs of the joints.
"""

import json
import sys
from collections.abc import Sequence
from time import process_time

from lockedjoint.formulations.atlas.collection import read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.atlas.export import INEQUIVALENT
from lockedjoint.formulations.atlas.improve import case_of
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.formulations.solving.solve import run

# Number of random starts of an entry. More of them may find more classes.
_STARTS = 20
# The seed of the starts: another one may find other classes.
_SEED = 0


def main(arguments: Sequence[str]) -> None:
    """Write the counts of entries whose turn comes within `arguments[0]` seconds.

    The file is written anew after each entry, and holds the entries of this run only.
    """
    pages = [page for page in read_atlas() if page.family == 0 and page.found.starts]
    pages.sort(key=lambda page: page.found.cpu_seconds / page.found.starts)
    begun, counts = process_time(), {}
    for page in pages:
        if process_time() - begun > float(arguments[0]):
            break
        counts[page.entry.name] = _counted(page)
        print(page.entry.name, counts[page.entry.name], file=sys.stderr)
        INEQUIVALENT.write_text(json.dumps(dict(sorted(counts.items())), indent=1) + "\n")


def _counted(page: EntryPage) -> tuple[int, int]:
    """Return the number of classes, with that of the page, and of starts as good as the page.

    A start is as good if its score differs by `REACHED_BEST` at most.
    """
    records = run(case_of(page.entry), starts=_STARTS, seed=_SEED).reached
    value = float(page.value)
    same = [one.jacobian for one in records if abs(one.score - value) <= REACHED_BEST]
    return len(group_equivalent([page.jacobian, *same])), len(same)


if __name__ == "__main__":
    main(sys.argv[1:])
