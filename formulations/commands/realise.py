"""``lockedjoint realise``: from a Jacobian to a robot."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from formulations.commands.arguments import (
    FigureOptions,
    JacobianFile,
    Json,
    Pick,
    Seed,
    flag,
    option,
    progress,
)
from formulations.commands.output import as_text, say, warn
from nlp.errors import InputError

if TYPE_CHECKING:
    from formulations.synthesis.choice import Choice
    from formulations.synthesis.manipulator import Manipulator

Slide = Literal["as-needed", "never", "length"]


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
        "How far a column may be from one that a joint can contribute.",
        1e-6,
        positive=True,
    )


@dataclass(frozen=True)
class Arrangement:
    """In which order and with which signs the columns are the joints of a robot."""

    criterion: str | None = option(
        "NAME",
        "Choose order and signs by: total-length, largest-link, dh-length, clearance, "
        "reach, neighbourhood, neighbourhood-before, workspace, workspace-before, kept;"
        " by default clearance, without --order and --signs.",
    )
    ranking: Path | None = option(
        "FILE", "CSV file for the orders and signs that were compared, the best first."
    )
    order: str | None = option(
        "J,J,...", "Columns from base to tip, counted from 0; or 'given', as they come."
    )
    signs: str | None = option(
        "+-...",
        "One per joint, from base to tip. Minus: the axis the other way round; in "
        "planar and positional tasks on the other side of the end effector.",
    )
    slide: Slide | None = option(
        None,
        "Slide joints along their axes: apart where links touch (as-needed), never, or "
        "to the least total length (length); by default as-needed; never with a "
        "criterion other than clearance.",
    )
    seed: Seed = 0
    samples: int = option("K", "Displacements that criteria sample.", 100, low=1)
    shortlist: int = option(
        "K",
        "How many arms are judged by criteria that sample: the shortest, or those that "
        "a coarse sample finds best.",
        200,
        low=1,
    )
    radius: float = option(
        "R",
        "Radius of the neighbourhood; of kept the half-width of artificial limits.",
        0.2,
        positive=True,
    )

    @property
    def is_given(self) -> bool:
        """Whether the order or the signs were given, and are not to be chosen."""
        return self.order is not None or self.signs is not None

    def choose(self, robot: Manipulator) -> tuple[Choice, bool]:
        """Choose an arrangement or take the one given; return it and whether joints slid."""
        from formulations.io.files import write_text
        from formulations.synthesis.choice import choose_arrangement, evaluate, given, rank
        from formulations.synthesis.criteria import Sampling
        from formulations.synthesis.links import link_gap, slide_apart
        from formulations.synthesis.links import slide as shortened

        sampling = Sampling(self.seed, self.samples, self.radius)
        if self.is_given:
            chosen = given(
                robot, _order(self.order), _flips(self.signs, robot.joints), sampling
            )
        else:
            name = self.criterion or "clearance"
            ranked = rank(robot, name, sampling, self.shortlist, progress)
            progress("")
            chosen = choose_arrangement(robot, name, sampling, self.shortlist, ranked)
            if self.ranking is not None:
                write_text(
                    self.ranking, ranked.table().to_csv(index=False, lineterminator="\n")
                )
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
    file: JacobianFile,
    reading: Reading,
    arrangement: Arrangement,
    figure: FigureOptions,
    to: Literal["axes", "dh", "urdf", "figure"] = option(None, "What is written.", "axes"),
    out: Path | None = option(
        "FILE",
        "Write to this file, and print what was chosen; a figure's name ends in .svg, "
        ".png or .pdf.",
    ),
    count: bool = flag(
        "--count", "Only print how many manipulators there are, and what is chosen."
    ),
    convention: Literal["standard", "modified"] = option(None, "Of --to dh.", "standard"),
    pick: Pick = None,
    as_json: Json = False,
) -> None:
    """Realise a Jacobian as a manipulator.

    Every column fixes one axis: a revolute joint with direction w passes through p - v x w,
    where p is the end effector. The order of the joints is free, and their signs: by default
    those with the largest clearance between links. Where columns do not fix an axis
    (positional tasks) its direction is the one nearest to z. Links that touch are named on
    standard error.
    """
    from formulations.commands import realise_forms as forms
    from formulations.io.files import prepare_file, write_bytes
    from formulations.measures.read_jacobians import only_jacobian
    from formulations.plot.style import looking
    from formulations.synthesis import from_jacobian

    if as_json and to == "figure":
        raise InputError("--json", "given", "none with --to figure")
    if arrangement.is_given and arrangement.criterion is not None:
        allowed = "none with --order or --signs"
        raise InputError("--criterion", arrangement.criterion, allowed)
    if not count:
        prepare_file(out, inputs=[file, figure.style])
    prepare_file(arrangement.ranking, "--ranking", [file, figure.style, out])
    look = figure.look()
    matrix = only_jacobian(file, pick)
    robot = from_jacobian.realise(matrix, **vars(reading))
    chosen, slid = arrangement.choose(robot)
    deviation = from_jacobian.deviation(chosen.manipulator, matrix, reading.length)
    summary = forms.summary(chosen, deviation, matrix) | {"slid": slid}
    signs = "".join("-" if flip else "+" for flip in chosen.flips)
    lines = as_text(summary | {"signs": signs})
    note = forms.touching_note(summary)
    if note is not None:
        warn(f"Note: {note}.")
    if count:
        say(json.dumps(summary, indent=1) if as_json else lines)
        return
    if as_json:
        everything = summary | forms.as_plain(chosen.manipulator, convention)
        content = f"{json.dumps(everything, indent=1)}\n".encode()
    else:
        form = "svg" if out is None else out.suffix.lower().removeprefix(".")
        with looking(look):
            content = forms.write_down(chosen.manipulator, to, convention, form)
    if out is None:
        typer.echo(content, nl=False)
    else:
        write_bytes(out, content)
        say(lines)


def _order(text: str | None) -> list[int] | None:
    if text is None or text == "given":
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        allowed = "columns counted from 0, separated by commas, or 'given'"
        raise InputError("--order", text, allowed) from None


def _flips(text: str | None, joints: int) -> list[bool] | None:
    if text is None:
        return None
    if len(text) != joints or set(text) - set("+-"):
        raise InputError("--signs", text, f"{joints} signs + or -, one per joint")
    return [sign == "-" for sign in text]
