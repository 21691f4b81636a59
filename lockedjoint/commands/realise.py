"""``lockedjoint realise``: from a Jacobian to a robot; axes, table, URDF or figure."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import flag, option
from lockedjoint.commands.output import as_table, as_text, progress, say, shown, warn
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.synthesis.choice import Choice
    from lockedjoint.synthesis.dh import DenavitHartenberg
    from lockedjoint.synthesis.manipulator import Manipulator

_DIGITS = 9


@dataclass(frozen=True)
class Reading:
    """How the columns of a Jacobian are read."""

    task: str | None = option(
        "NAME",
        "planar (2 rows), positional, planar-pose, rotational (3) or spatial (6); by "
        "default by the number of rows.",
    )
    kinds: str | None = option(
        "RP...", "Revolute or prismatic, one letter per column; by default from the columns."
    )
    length: float = option("L", "Metres per unit of linear velocity.", 1.0, positive=True)
    tolerance: float = option(
        "TOL",
        "Largest | |ω| − 1 | and |v·ω| of a column of a revolute joint.",
        1e-6,
        positive=True,
    )


@dataclass(frozen=True)
class Arrangement:
    """In which order and with which signs the columns are the joints of a robot."""

    criterion: str | None = option(
        "NAME",
        "What the order and the signs are best at: total-length, largest-link, dh-length, "
        "clearance, reach, neighbourhood, neighbourhood-before, workspace, "
        "workspace-before or kept, see docs/realise.md. By default clearance; not with "
        "--order or --signs.",
    )
    ranking: Path | None = option(
        "FILE", "CSV file for the orders and signs that were compared, the best first."
    )
    order: str | None = option(
        "J,J,...", "Columns from base to tip, counted from 0; or 'given', as in the file."
    )
    signs: str | None = option(
        "+-...",
        "One per joint, from base to tip. Minus: the axis the other way round; in "
        "planar and positional tasks on the other side of the end effector.",
    )
    slide: Literal["as-needed", "never", "length"] | None = option(
        None,
        "Slide joints along their axes: apart where links touch (as-needed), never, or "
        "to the least total length (length). By default as-needed; never with a "
        "criterion other than clearance.",
    )
    seed: cli.Seed = 0
    samples: int = option("K", "How many displacements criteria sample.", 100, low=1)
    shortlist: int = option(
        "K",
        "How many arms the criteria that sample compare: the shortest ones, or the best of "
        "a coarse sample.",
        200,
        low=1,
    )
    radius: float = option(
        "R",
        "Radius of the neighbourhood, radians and metres; for kept the half-width of the "
        "artificial limits.",
        0.2,
        positive=True,
    )

    @property
    def is_given(self) -> bool:
        """Whether the order or the signs were given, and are not to be chosen."""
        return self.order is not None or self.signs is not None

    def choose(self, robot: Manipulator) -> tuple[Choice, bool]:
        """Choose an arrangement or take the one given; return it and whether joints slid."""
        from lockedjoint.formulations.io.escaping import frame_csv
        from lockedjoint.formulations.io.files import write_text
        from lockedjoint.synthesis.choice import choose_arrangement, evaluate, given, rank
        from lockedjoint.synthesis.criteria import Sampling
        from lockedjoint.synthesis.links import link_gap, slide_apart
        from lockedjoint.synthesis.links import slide as shortened

        sampling = Sampling(self.seed, self.samples, self.radius)
        if self.is_given:
            flips = _flips(self.signs, robot.joints)
            text = None if self.order == "given" else self.order
            allowed = "columns counted from 0, separated by commas, or 'given'"
            order = None if text is None else cli.listed(text, int, "--order", allowed)
            chosen = given(robot, order, flips, sampling)
        else:
            name = self.criterion or "clearance"
            ranked = rank(robot, name, sampling, self.shortlist, progress)
            chosen = choose_arrangement(robot, name, sampling, self.shortlist, ranked)
            if self.ranking is not None:
                lines = frame_csv(ranked.table())
                write_text(self.ranking, lines)
        usual = "as-needed" if self.criterion in (None, "clearance") else "never"
        slide = self.slide or usual
        moved = chosen.manipulator
        if slide == "length":
            moved = shortened(moved)
        elif slide == "as-needed" and link_gap(moved).touching:
            moved = slide_apart(moved, self.seed)
        if moved is chosen.manipulator:
            return chosen, False
        return replace(chosen, manipulator=moved, values=evaluate(moved, sampling)), True


def realise(
    file: cli.JacobianFile,
    *,
    to: Literal["axes", "dh", "urdf", "figure"] = option(None, "What is written.", "axes"),
    out: Path | None = option(
        "FILE",
        "Write to this file, and print what was chosen; a figure's name ends in .svg, "
        ".png or .pdf, that of a table that `measure-robot` reads in .csv.",
    ),
    convention: Literal["standard", "modified"] = option(
        None, "Denavit–Hartenberg convention, with --to dh.", "standard"
    ),
    count: bool = flag(
        "--count", "Only print how many manipulators there are, and what is chosen."
    ),
    pick: cli.Pick = None,
    reading: Reading,
    arrangement: Arrangement,
    figure: cli.FigureOptions,
    as_json: cli.Json = False,
) -> None:
    """Realise a Jacobian as a manipulator.

    Every column fixes one axis: a revolute joint with direction w passes through p - v x w,
    where p is the end effector. The order of the joints is free, and their signs: by default
    those with the largest clearance between links. Where columns do not fix an axis
    (positional tasks) its direction is the one nearest to z. Links that touch are named on
    standard error.
    """
    from lockedjoint.figures.style import content as image
    from lockedjoint.figures.style import looking
    from lockedjoint.formulations import measures
    from lockedjoint.formulations.io.files import prepare_file, write_bytes
    from lockedjoint.formulations.measures.read_jacobians import NO_ANSWER, only_jacobian
    from lockedjoint.nlp.arrays import finite_or_none
    from lockedjoint.synthesis import from_jacobian
    from lockedjoint.synthesis.dh import Convention, denavit_hartenberg
    from lockedjoint.synthesis.links import link_gap
    from lockedjoint.synthesis.write_urdf import urdf

    if as_json and to == "figure":
        raise InputError("--json", "given", "none with --to figure")
    if arrangement.is_given and arrangement.criterion is not None:
        raise InputError("--criterion", arrangement.criterion, "none with --order or --signs")
    if not count:
        prepare_file(out, inputs=[file, figure.style])
    prepare_file(arrangement.ranking, "--ranking", [file, figure.style, out])
    look = figure.look()
    name, matrix = only_jacobian(file, pick)
    if name.endswith(NO_ANSWER):
        warn(f"Note: this is a robot of what {file} has: {name}.")
    robot = from_jacobian.realise(matrix, **vars(reading))
    chosen, slid = arrangement.choose(robot)
    made = chosen.manipulator
    clearance = link_gap(made)
    touching = [list(pair) for pair in clearance.touching]
    summary = {
        "name": name,
        **chosen.to_dict(),
        # Of the robot, in metres, and of the Jacobian, in its own unit of length.
        "worst_case_sigma": measures.worst_case_sigma(made.jacobian()),
        "worst_case_sigma_given": measures.worst_case_sigma(matrix),
        "speeds": made.speeds.tolist(),
        "deviation": from_jacobian.deviation(made, matrix, reading.length),
        "gap": finite_or_none(clearance.gap),
        "touching": touching,
        "slid": slid,
    }
    signs = "".join("-" if flip else "+" for flip in chosen.flips)
    lines = as_text(summary | {"signs": signs})
    if touching:
        pairs = [f"{i} and {j}" for i, j in touching]
        named = ", ".join(pairs[:8]) + (f", … ({len(pairs)} pairs)" if len(pairs) > 8 else "")
        bodies = f"bodies overlap by {-clearance.gap:.3g} m"
        warn(f"Note: links {named} touch (counted from 0): {bodies}.")
    speeds = [f"{speed:.6g} m" for speed in made.speeds.tolist() if speed != 1]
    if to == "urdf" and speeds:
        unit = f"move {', '.join(speeds)} per unit of the Jacobian"
        read = "measure-robot reads this in <lockedjoint>, other programs take metres"
        warn(f"Note: prismatic joints {unit}; {read}.")
    if count:
        say(json.dumps(summary, indent=1) if as_json else lines)
        return
    form = "svg" if out is None else out.suffix.lower().removeprefix(".")
    table = denavit_hartenberg(made, Convention(convention))
    if as_json:
        plain = summary | made.to_dict() | {"dh": table.to_dict(), "urdf": urdf(made)}
        content = f"{json.dumps(plain, indent=1)}\n".encode()
    elif to == "figure":
        from lockedjoint.figures.manipulator import figure as drawn

        with looking(look):
            content = image(drawn(made), form)
    elif to == "urdf":
        content = urdf(made).encode()
    elif to == "axes":
        axes = made.to_dict()
        tip = shown(axes["end_effector"])
        content = f"{as_table(axes['joints'], _DIGITS)}\n\nend effector  {tip}\n".encode()
    else:
        content = _table(table, made, form).encode()
    if out is None:
        own, given = summary["worst_case_sigma"], summary["worst_case_sigma_given"]
        if abs(own - given) > 1e-9 * given:
            units = f"of the Jacobian {given:.6g}, in its own unit of length"
            warn(f"Note: the worst-case σ of this robot is {own:.6g}, in metres; {units}.")
        typer.echo(content, nl=False)
    else:
        write_bytes(out, content)
        say(lines)


def _flips(text: str | None, joints: int) -> list[bool] | None:
    if text is None:
        return None
    if len(text) != joints or set(text) - set("+-"):
        raise InputError("--signs", text, f"{joints} signs + or -, one per joint")
    return [sign == "-" for sign in text]


def _table(table: DenavitHartenberg, made: Manipulator, form: str) -> str:
    from tabulate import tabulate

    if form == "csv":
        if (made.speeds != 1.0).any():
            raise InputError("--out", "a table in CSV", "text or URDF; CSV has no speeds")
        return table.csv()
    modified = table.convention == "modified"
    before = {"a": "a before", "alpha": "alpha before"} if modified else {}
    rows = [
        {**{before.get(k, k): v for k, v in row.items()}, "speed": speed}
        for row, speed in zip(table.rows(), made.speeds.tolist(), strict=True)
    ]
    parts = [f"{table.convention} convention", as_table(rows, _DIGITS)]
    for name, pose in (("base", table.base), ("tool", table.tool)):
        numbers = tabulate(pose.tolist(), tablefmt="plain", floatfmt=f".{_DIGITS}g")
        parts.append(f"{name}\n{numbers}")
    return "\n\n".join(parts) + "\n"
