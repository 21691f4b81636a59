"""Prove the exact values of the atlas, or find them.

    python results/atlas/exact.py [ENTRY ...]

proves what is on file, in exact arithmetic: that an exact Jacobian next to the entry's has the
worst case that is shown, and where the file says so, that it is a strict local maximum. It
needs no further package, and ends with status 1 if a proof fails.

    pip install cypari && python results/atlas/exact.py --find [--digits 1500] [ENTRY ...]

finds exact values anew by PARI/GP, and writes formulations/atlas/exact.json and
results/atlas/exact_proofs.json. Polynomials of degree 11 and more, that of unit revolute 7R
among them, need 1500 digits.

The value is t = σ², the squared worst case of the entry. What is proved is printed, one of the
words of `ExactValue`: maximum, sharp maximum, attained or numerical; `exact_proof` proves it,
`exact_search` finds it, and `exact_optimum` says what the files hold.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

from lockedjoint.formulations.atlas.collection import atlas, proved_maximum, read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.errors import InputError
from results.atlas.exact_optimum import records
from results.atlas.exact_proof import prove_exact_value

# Numbers of decimal digits with which a polynomial is sought, one after the other, unless the
# command line says others. More digits find larger degrees, and take longer.
_DIGITS = (320, 1000)


def verify(pages: Sequence[EntryPage]) -> int:
    """Prove exact values of pages, print what is proved, and return the exit status."""
    counts = Counter[str]()
    for page in pages:
        try:
            result = proved(page)
            print(f"{page.entry.name}: {result}", flush=True)
        except CertificateError as error:
            result = "wrong"
            print(f"{page.entry.name}: {error}", flush=True)
        counts[result] += 1
    print(", ".join(f"{result}: {count}" for result, count in counts.items()))
    return 1 if counts["wrong"] else 0


def proved(page: EntryPage) -> str:
    """Prove the exact value of a page and return what is proved, or raise CertificateError."""
    exact = page.exact
    if exact is None:
        raise CertificateError("there is no exact value on record next to its value.")
    maximum = None
    if exact.proof == "maximum":
        maximum = proved_maximum(page.entry, page.jacobian, exact.active_sets)
    prove_exact_value(page.entry, page.jacobian, maximum)
    return exact.proof


def main() -> int:
    """Do what the command line asks for."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("entries", nargs="*", metavar="ENTRY", help="by default all")
    options.add_argument("--find", action="store_true", help="find them anew; needs cypari")
    options.add_argument("--digits", type=int, nargs="+", default=_DIGITS, metavar="D")
    given = options.parse_args()
    if given.find:
        from results.atlas.exact_search import find

        find(given.entries, given.digits)
        return 0
    try:
        pages = [atlas(name) for name in given.entries]
    except InputError as error:
        options.error(str(error))
    return verify(pages or [page for page in read_atlas() if page.entry.name in records()])


if __name__ == "__main__":
    sys.exit(main())
