"""A quadratic program in the formats of other optimisers: AMPL .nl, CUTEst SIF, JuMP.

What comes in: a `QuadraticProgram`. What goes out: the text of a file. A new format is a
function here, listed in `FORMATS` by the ending of its files.
"""

from collections.abc import Callable, Mapping

import numpy as np

from results.optimisers.quadratic_program import QuadraticProgram

# Number of characters of a number in a SIF file.
_SIF_NUMBER = 12
# A SIF file ends with this description of its two element types: products and squares.
_ELEMENTS = """\
ELEMENTS      {name}
INDIVIDUALS
 T  2PR
 F                      X * Y
 G  X                   Y
 G  Y                   X
 H  X         Y         1.0
 T  SQ
 F                      X * X
 G  X                   X + X
 H  X         X         2.0
ENDATA
"""


def as_nl(program: QuadraticProgram) -> str:
    """Return the text of an AMPL .nl file.

    Products stand in the constraints' expressions (segments C), coefficients of linear terms in
    segments J. Each variable of a constraint has one there, 0 if it occurs in products only.
    """
    constraints, size = program.constraints, program.size
    curved = sum(bool(one.products) for one in constraints)
    coefficients: list[dict[int, float]] = []
    for one in constraints:
        variables = {i for pair in one.products for i in pair} | set(one.linear)
        coefficients.append({i: one.linear.get(i, 0.0) for i in sorted(variables)})
    counts = np.bincount([i for one in coefficients for i in one], minlength=size)
    lines = [
        f"g3 1 1 0 # {program.name}",
        f" {size} {len(constraints)} 1 0 {sum(not one.limit for one in constraints)}",
        f" {curved} 0",
        " 0 0",
        f" {size - 1} 0 0",
        " 0 0 0 1",
        " 0 0 0 0 0",
        f" {counts.sum()} 1",
        " 0 0",
        " 0 0 0 0 0",
    ]
    for number, one in enumerate(constraints):
        lines.append(f"C{number}")
        terms = [f"o2\nn{c!r}\no2\nv{i}\nv{j}" for (i, j), c in one.products.items()]
        # The operator of a sum: none, of two terms, of any number of terms.
        operator = {0: ["n0"], 1: [], 2: ["o0"]}.get(len(terms), ["o54", str(len(terms))])
        lines += [*operator, *terms]
    lines += ["O0 1", "n0", f"x{size}"]
    lines += [f"{i} {value!r}" for i, value in enumerate(program.start.tolist())]
    lines += ["r", *(f"{1 if one.limit else 4} {one.level!r}" for one in constraints)]
    lines += ["b", *("2 0" if bound else "3" for bound in program.not_negative)]
    lines += [f"k{size - 1}", *map(str, np.cumsum(counts)[:-1])]
    for number, row in enumerate(coefficients):
        lines += [f"J{number} {len(row)}", *(f"{i} {factor!r}" for i, factor in row.items())]
    return "\n".join([*lines, "G0 1", f"{size - 1} 1", ""])


def as_sif(program: QuadraticProgram) -> str:
    """Return the text of a CUTEst .SIF file, which minimises −t."""
    model, size, locked = program.name.upper().split("_")
    name = f"LJ{model[0]}{size}{locked}"
    pairs = dict.fromkeys(pair for one in program.constraints for pair in one.products)
    elements = {pair: f"P{place}" for place, pair in enumerate(pairs)}
    lines = [
        f"* {program.name}: minus the squared worst case is minimised.",
        f"NAME          {name}",
    ]
    lines += ["VARIABLES", *(_card("", f"X{i}") for i in range(program.size))]
    lines += ["GROUPS", _card("N", "OBJ", f"X{program.size - 1}", -1.0)]
    for number, one in enumerate(program.constraints):
        kind = "L" if one.limit else "E"
        lines += [_card(kind, f"C{number}", f"X{i}", c) for i, c in one.linear.items()]
        lines += [] if one.linear else [_card(kind, f"C{number}")]
    levels = [
        _card("", name, f"C{number}", one.level)
        for number, one in enumerate(program.constraints)
        if one.level
    ]
    bounded = np.flatnonzero(program.not_negative)
    lines += ["CONSTANTS", *levels, "BOUNDS", _card("FR", name, "'DEFAULT'")]
    lines += [_card("LO", name, f"X{i}", 0.0) for i in bounded]
    lines += ["START POINT"]
    lines += [_card("", name, f"X{i}", x) for i, x in enumerate(program.start.tolist())]
    lines += ["ELEMENT TYPE", _card("EV", "2PR", "X"), _card("EV", "2PR", "Y")]
    lines += [_card("EV", "SQ", "X"), "ELEMENT USES"]
    for (i, j), element in elements.items():
        kind = "SQ" if i == j else "2PR"
        lines += [_card("T", element, kind), _card("V", element, "X", f"X{i}")]
        lines += [] if i == j else [_card("V", element, "Y", f"X{j}")]
    lines += ["GROUP USES"]
    for number, one in enumerate(program.constraints):
        lines += [_card("E", f"C{number}", elements[ij], c) for ij, c in one.products.items()]
    return "\n".join([*lines, "ENDATA", "", _ELEMENTS.format(name=name)])


def _card(kind: str, first: str, second: str = "", third: str | float = "") -> str:
    """Return a line of SIF, whose fields have fixed places."""
    if isinstance(third, float):
        texts = (f"{third:.{digits}g}" for digits in range(_SIF_NUMBER, 0, -1))
        third = next(text for text in texts if len(text) <= _SIF_NUMBER)
        return f" {kind:<2} {first:<10}{second:<10}{third:>12}"
    return f" {kind:<2} {first:<10}{second:<25}{third}".rstrip()


def as_jump(program: QuadraticProgram) -> str:
    """Return a Julia file with a function that states the problem in JuMP."""
    bounded = ", ".join(str(i + 1) for i in np.flatnonzero(program.not_negative))
    products = [
        f"({number}, {i + 1}, {j + 1}, {c!r})"
        for number, one in enumerate(program.constraints, 1)
        for (i, j), c in one.products.items()
    ]
    linear = [
        f"({number}, {i + 1}, {c!r})"
        for number, one in enumerate(program.constraints, 1)
        for i, c in one.linear.items()
    ]
    limits = ", ".join(str(one.limit).lower() for one in program.constraints)
    return f"""\
# {program.name}: the squared worst case is maximised.
using JuMP

const START = {program.start.tolist()}
const NOT_NEGATIVE = [{bounded}]
const LEVELS = {[one.level for one in program.constraints]}
const LIMITS = [{limits}]
const PRODUCTS = [{", ".join(products)}]
const LINEAR = [{", ".join(linear)}]

function problem()
    model = Model()
    @variable(model, x[i = 1:{program.size}], start = START[i])
    set_lower_bound.(x[NOT_NEGATIVE], 0.0)
    @objective(model, Max, x[end])
    left = [zero(QuadExpr) for _ in LEVELS]
    for (row, i, j, factor) in PRODUCTS
        add_to_expression!(left[row], factor, x[i], x[j])
    end
    for (row, i, factor) in LINEAR
        add_to_expression!(left[row], factor, x[i])
    end
    for (row, level) in enumerate(LEVELS)
        if LIMITS[row]
            @constraint(model, left[row] <= level)
        else
            @constraint(model, left[row] == level)
        end
    end
    return model
end
"""


#: What writes a program as text, by the ending of the file's name.
FORMATS: Mapping[str, Callable[[QuadraticProgram], str]] = {
    "nl": as_nl,
    "sif": as_sif,
    "jl": as_jump,
}
