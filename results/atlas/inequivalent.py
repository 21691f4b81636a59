"""How many inequivalent best Jacobians isolated entries have among twenty random starts.

Cheap entries first, until so many seconds of processor time are over. Two are the same if they
differ by the frame, the phase, the mirror image, the order or the signs of the joints.
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


def main(arguments: Sequence[str]) -> None:
    """Write the counts of entries whose turn comes within `arguments[0]` seconds."""
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
    """Return the number of classes, with that of the page, and of starts that reached it."""
    records = run(case_of(page.entry), starts=20, seed=0).reached
    value = float(page.value)
    same = [one.jacobian for one in records if abs(one.score - value) <= REACHED_BEST]
    return len(group_equivalent([page.jacobian, *same])), len(same)


if __name__ == "__main__":
    main(sys.argv[1:])
