"""``lockedjoint realise``: from a Jacobian to a robot; axes, table, URDF or figure.

What comes in: a file with a Jacobian, m × n, whose columns are joints. What goes out: a
manipulator with these joints, in an order and with signs that a criterion chooses, in the form
that --to asks for. The geometry is in `lockedjoint.synthesis`.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from lockedjoint.commands.bars import progress
from lockedjoint.commands.output import as_table, as_text, say, shown, warn
from lockedjoint.commands.shared import check_style, looking_like
from lockedjoint.nlp.errors import InputError, one_of

if TYPE_CHECKING:
    from lockedjoint.synthesis.choice import Choice
    from lockedjoint.synthesis.criteria import Sampling
    from lockedjoint.synthesis.dh import DenavitHartenberg
    from lockedjoint.synthesis.links import LinkGap
    from lockedjoint.synthesis.manipulator import Manipulator

# Number of digits of axes and tables that are shown. JSON, URDF and CSV have all.
_DIGITS = 9
# Largest number of pairs of links that touch which a note names.
_MOST_NAMED_PAIRS = 8
# Relative difference of the robot's worst case from the Jacobian's above which a note says so.
_SAME_SIGMA_SHARE = 1e-9
# Least radius of limits: above 0.
_LEAST_RADIUS = 1e-300
# Forms of `realise --to`. Another one needs a branch in `_content`.
_FORMS = ("axes", "dh", "modified-dh", "urdf", "figure", "choice", "ranking")


@dataclass(frozen=True)
class ArrangementEffort:
    """How much is tried for the best arrangement: the fields that --effort takes.

    Attributes
    ----------
    samples
        Positions that kept samples.
    shortlist
        Arms that kept and criteria of plugins compare: the best of a coarse sample, or the
        shortest ones.
    radius
        Half-width of the artificial limits of kept, radians and metres.
    seed
        Random seed.
    """

    samples: int = 100
    shortlist: int = 200
    radius: float = 0.2
    seed: int = 0

    def __post_init__(self) -> None:
        from lockedjoint.nlp.arrays import real_number, whole_number

        whole_number("samples", self.samples, 1)
        whole_number("shortlist", self.shortlist, 1)
        real_number("radius", self.radius, "a finite number above 0", _LEAST_RADIUS)
        whole_number("seed", self.seed, 0)

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> ArrangementEffort:
        """Return an effort with the fields given; InputError if one has no such name."""
        known = [one.name for one in fields(cls)]
        for name in given:
            one_of("--effort", name, known)
        return cls(**given)

    @property
    def sampling(self) -> Sampling:
        """Which positions kept samples."""
        from lockedjoint.synthesis.criteria import Sampling

        return Sampling(self.seed, self.samples, self.radius)


class Arranged(NamedTuple):
    """A robot whose joints have their order and signs, and have slid where that was asked."""

    choice: Choice  #: The robot, and how its order and signs were chosen.
    slid: bool  #: Whether joints slid along their axes.
    #: All arrangements that were compared, the best first, as CSV; empty if one was given.
    ranking: str


@dataclass(frozen=True)
class Arrangement:
    """In which order and with which signs the columns are the joints of a robot.

    Parameters
    ----------
    criterion
        What the order and the signs are best at: clearance, total-length, kept, or a criterion
        that a --plugin registers, see docs/realise.md. By default clearance; not with --order.
    order
        Columns from base to tip, counted from 0, with - after one whose axis is the other way
        round (in planar and positional tasks on the other side of the end effector): 2,0-,1; or
        'given', as in the file. By default the best by the criterion.
    slide
        Slide joints along their axes: apart where links touch (as-needed), never, or to the
        least total length (length). By default as-needed; never with a criterion other than
        clearance.
    effort
        How much is tried. May be repeated: samples of positions (100), shortlist of arms that
        are compared (200), radius, half the width of the limits in radians and metres (0.2),
        seed (0): for kept; the shortlist also for a criterion of a --plugin.
    """

    criterion: str | None = None
    order: str | None = None
    slide: str | None = None
    effort: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_given(self) -> bool:
        """Whether the order or the signs were given, and are not to be chosen."""
        return self.order is not None

    def choose(self, robot: Manipulator) -> Arranged:
        """Choose an arrangement, or take the one that was given, and slide its joints."""
        from lockedjoint.formulations.io.escaping import rows_csv
        from lockedjoint.synthesis.choice import choose_arrangement, evaluate, given
        from lockedjoint.synthesis.links import link_gap, slide_apart
        from lockedjoint.synthesis.links import slide as shortened
        from lockedjoint.synthesis.ranking import rank

        effort = ArrangementEffort.of(self.effort)
        sampling = effort.sampling
        if self.is_given:
            order, flips = _order(str(self.order))
            chosen, ranking = given(robot, order, flips, sampling), ""
        else:
            name = self.criterion or "clearance"
            ranked = rank(robot, name, sampling, effort.shortlist, progress)
            chosen = choose_arrangement(robot, name, sampling, effort.shortlist, ranked)
            ranking = rows_csv(ranked.rows())
        usual = "as-needed" if self.criterion in (None, "clearance") else "never"
        slide = self.slide or usual
        moved = chosen.manipulator
        if slide == "length":
            moved = shortened(moved)
        elif slide == "as-needed" and link_gap(moved).touching:
            moved = slide_apart(moved, effort.seed)
        if moved is chosen.manipulator:
            return Arranged(chosen, False, ranking)
        slid = replace(
            chosen, manipulator=moved, values=evaluate(moved, sampling, tuple(chosen.values))
        )
        return Arranged(slid, True, ranking)


def realise(
    file: Path,
    arrangement: Arrangement,
    to: str = "axes",
    space: str | None = None,
    kinds: str | None = None,
    metres: float = 1.0,
    relative_tolerance: float = 1e-6,
    out: Path | None = None,
    figure_style: Path | None = None,
    as_json: bool = False,
) -> None:
    """Realise a Jacobian as a manipulator.

    Every column (v; w) fixes one axis: that of a revolute joint has the direction w and passes
    through p - v x w, where p is the end effector. The order of the joints and their signs are
    free: by default they are those with the largest clearance between links. Where columns do
    not fix an axis (positional tasks) its direction is the one nearest to z. Links that touch
    are named on standard error.

    Parameters
    ----------
    file
        A Jacobian in CSV, NPY, NPZ or JSON, one column per joint, after # its number in a file
        of several, counted from 0.
    to
        The form of what is printed: axes; a Denavit–Hartenberg table, dh or modified-dh; urdf;
        figure; choice, only how many manipulators there are and which is chosen; or ranking,
        the orders and signs that were compared, the best first, in CSV.
    space
        What the rows are: planar (2 rows), positional, planar-pose, rotational (3) or spatial
        (6); by default by the number of rows.
    kinds
        Revolute or prismatic, one letter per column; by default from the columns.
    metres
        Metres per unit of linear velocity.
    relative_tolerance
        A relative tolerance: the largest | |ω| − 1 | and |v·ω| of the column of a revolute
        joint.
    out
        The file that is written: what is asked for, while what was chosen is printed; a
        figure's name ends in .svg, .png or .pdf, that of a table that `measure` reads in .csv.
    """
    from lockedjoint.formulations import measures
    from lockedjoint.formulations.io.files import prepare_file, write_bytes
    from lockedjoint.formulations.measures.read_jacobians import NO_ANSWER, only_jacobian
    from lockedjoint.nlp.arrays import finite_or_none
    from lockedjoint.synthesis import from_jacobian
    from lockedjoint.synthesis.links import link_gap

    _check_options(arrangement, to, out, as_json)
    prepare_file(out, inputs=[file, figure_style])
    check_style(figure_style, to == "figure", "one with --to figure")
    name, matrix = only_jacobian(file)
    if name.endswith(NO_ANSWER):
        warn(f"Note: this is a robot of what {file} has: {name}.")
    robot = from_jacobian.realise(
        matrix, space=space, kinds=kinds, metres=metres, tolerance=relative_tolerance
    )
    chosen, slid, ranking = arrangement.choose(robot)
    made = chosen.manipulator
    clearance = link_gap(made)
    summary = {
        "name": name,
        **chosen.to_dict(),
        # The robot is in metres, the Jacobian in its own unit of length.
        "worst_case_sigma": measures.worst_case_sigma(made.jacobian()),
        "worst_case_sigma_given": measures.worst_case_sigma(matrix),
        "speeds": made.speeds.tolist(),
        "deviation": from_jacobian.deviation(made, matrix, metres),
        "gap": finite_or_none(clearance.gap),
        "touching": [list(pair) for pair in clearance.touching],
        "slid": slid,
    }
    signs = "".join("-" if flip else "+" for flip in chosen.flips)
    lines = as_text(summary | {"signs": signs})
    _note_touching(clearance)
    if to == "urdf":
        _note_speeds(made)
    if to == "choice":
        say(json.dumps(summary, indent=1) if as_json else lines)
        return
    form = "svg" if out is None else out.suffix.lower().removeprefix(".")
    if to == "ranking":
        content = ranking.encode()
    else:
        content = _content(made, to, form, figure_style, summary if as_json else None)
    if out is None:
        own, given = summary["worst_case_sigma"], summary["worst_case_sigma_given"]
        if abs(own - given) > _SAME_SIGMA_SHARE * given:
            units = f"of the Jacobian {given:.6g}, in its own unit of length"
            warn(f"Note: the worst-case σ of this robot is {own:.6g}, in metres; {units}.")
        click.echo(content, nl=False)
    else:
        write_bytes(out, content)
        say(lines)


def _check_options(arrangement: Arrangement, to: str, out: Path | None, as_json: bool) -> None:
    """Refuse options that do not go together: InputError."""
    one_of("--to", to, _FORMS)
    if as_json and to in ("figure", "ranking"):
        raise InputError("--json", "given", f"none with --to {to}")
    if out is not None and to == "choice":
        raise InputError("--out", out, "none with --to choice, which is only printed")
    if arrangement.is_given and to == "ranking":
        raise InputError("--to", to, "none with --order")
    if arrangement.is_given and arrangement.criterion is not None:
        raise InputError("--criterion", arrangement.criterion, "none with --order")


def _note_touching(clearance: LinkGap) -> None:
    """Name the links that touch on standard error, if there are any."""
    if clearance.touching:
        pairs = [f"{i} and {j}" for i, j in clearance.touching]
        named = ", ".join(pairs[:_MOST_NAMED_PAIRS])
        if len(pairs) > _MOST_NAMED_PAIRS:
            named += f", … ({len(pairs)} pairs)"
        bodies = f"bodies overlap by {-clearance.gap:.3g} m"
        warn(f"Note: links {named} touch (counted from 0): {bodies}.")


def _note_speeds(made: Manipulator) -> None:
    """Say on standard error, if so, that prismatic joints have units other than a metre."""
    speeds = [f"{speed:.6g} m" for speed in made.speeds.tolist() if speed != 1]
    if speeds:
        unit = f"move {', '.join(speeds)} per unit of the Jacobian"
        read = "measure reads this in <lockedjoint>, other programs take metres"
        warn(f"Note: prismatic joints {unit}; {read}.")


def _content(
    made: Manipulator,
    to: str,
    form: str,
    figure_style: Path | None,
    summary: Mapping[str, object] | None,
) -> bytes:
    """Return a robot in the form that --to asks for, or all of it as JSON with a summary.

    `form` is the format of a file, the ending of its name without the dot: that of a figure
    (svg, png, pdf), or csv for a Denavit–Hartenberg table; other endings have a table as text.
    """
    from lockedjoint.synthesis.dh import Convention, denavit_hartenberg
    from lockedjoint.synthesis.write_urdf import urdf

    convention = "modified" if to == "modified-dh" else "standard"
    table = denavit_hartenberg(made, Convention(convention))
    if summary is not None:
        plain = {**summary, **made.to_dict(), "dh": table.to_dict(), "urdf": urdf(made)}
        return f"{json.dumps(plain, indent=1)}\n".encode()
    if to == "figure":
        from lockedjoint.figures.manipulator import figure as drawn
        from lockedjoint.figures.style import content as image

        with looking_like(figure_style):
            return image(drawn(made), form)
    if to == "urdf":
        return urdf(made).encode()
    if to == "axes":
        axes = made.to_dict()
        tip = shown(axes["end_effector"])
        return f"{as_table(axes['joints'], _DIGITS)}\n\nend effector  {tip}\n".encode()
    return _table(table, made, form).encode()


def _order(text: str) -> tuple[list[int] | None, list[bool] | None]:
    """Read --order: the columns from base to tip, and which axes are the other way round.

    Both are None for 'given': columns in the order of the file, none turned.
    """
    if text == "given":
        return None, None
    parts = [part.strip() for part in text.split(",")]
    try:
        columns = [int(part.removesuffix("-")) for part in parts]
    except ValueError:
        allowed = "columns counted from 0, with commas, each with - after it or not; or 'given'"
        raise InputError("--order", text, allowed) from None
    return columns, [part.endswith("-") for part in parts]


def _table(table: DenavitHartenberg, made: Manipulator, form: str) -> str:
    """Return a Denavit–Hartenberg table as text, or as CSV if `form` is the ending csv."""
    from tabulate import tabulate

    if form == "csv":
        if (made.speeds != 1.0).any():
            raise InputError("--out", "a table in CSV", "text or URDF; CSV has no speeds")
        return table.csv()
    modified = table.convention == "modified"
    titles = {"theta": "theta (rad)", "alpha": "alpha (rad)"}
    if modified:
        titles |= {"a": "a before", "alpha": "alpha before (rad)"}
    rows = [
        {**{titles.get(k, k): v for k, v in row.items()}, "speed": speed}
        for row, speed in zip(table.rows(), made.speeds.tolist(), strict=True)
    ]
    parts = [f"{table.convention} convention", as_table(rows, _DIGITS)]
    for name, pose in (("base", table.base), ("tool", table.tool)):
        numbers = tabulate(pose.tolist(), tablefmt="plain", floatfmt=f".{_DIGITS}g")
        parts.append(f"{name}\n{numbers}")
    return "\n\n".join(parts) + "\n"
