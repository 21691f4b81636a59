"""Write an entry of the atlas as a quadratic program: a test problem for optimisers.

    python results/optimisers/write_problem.py ENTRY FILE

The optimum is the squared worst case. The file's name says the format: AMPL .nl, CUTEst .sif,
or .jl, Julia for JuMP. The start in the file is feasible.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lockedjoint.formulations.atlas.collection import atlas
from lockedjoint.formulations.io.files import prepare_file, write_text
from lockedjoint.nlp.errors import InputError, LockedJointError
from results.optimisers.formats import FORMATS
from results.optimisers.quadratic_program import quadratic_program


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the file that the command line asks for, and print the problem's size."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("entry", metavar="ENTRY", help="a name that `lockedjoint atlas` lists")
    options.add_argument("out", metavar="FILE", type=Path, help="ends in .nl, .sif or .jl")
    given = options.parse_args(arguments)
    try:
        ending = given.out.suffix.lower().removeprefix(".")
        if ending not in FORMATS:
            raise InputError("FILE", str(given.out), "a name that ends in .nl, .sif or .jl")
        page = atlas(given.entry)
        program = quadratic_program(page.entry)
        prepare_file(given.out)
        write_text(given.out, FORMATS[ending](program))
    except LockedJointError as error:
        options.error(str(error))
    known, bound = float(page.value) ** 2, page.entry.bound.value**2
    print(f"{program.size} variables, {len(program.constraints)} constraints")
    print(f"best t known: {known:.10g}, bound: {bound:.10g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
