"""``lockedjoint realise``: from a Jacobian to a robot."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import (
    Json,
    Pick,
    Seed,
    Size,
    Style,
    look,
    positive_option,
    refuse_unused,
    whole_option,
)
from formulations.commands.arguments import progress as show_progress
from formulations.commands.output import as_text
from nlp.errors import InputError

SLIDES = ("as-needed", "never", "length")


def realise(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="CSV, NPY, NPZ or JSON; one column per joint."),
    ],
    to: Annotated[str, typer.Option(metavar="FORM", help="axes, dh, urdf or figure.")] = "axes",
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write to this file, and print what was chosen; a figure's name ends in .svg, "
            ".png or .pdf.",
        ),
    ] = None,
    criterion: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Choose order and signs by: total-length, largest-link, dh-length, clearance, "
            "reach, neighbourhood, neighbourhood-before, workspace, workspace-before, kept.",
            show_default="clearance, without --order and --signs",
        ),
    ] = None,
    ranking: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="CSV file for the orders and signs that were compared, the best first.",
            show_default=False,
        ),
    ] = None,
    order: Annotated[
        str | None,
        typer.Option(
            metavar="J,J,...",
            help="Columns from base to tip, counted from 0; or 'given', as they come.",
        ),
    ] = None,
    signs: Annotated[
        str | None,
        typer.Option(
            metavar="+-...",
            help="One per joint, from base to tip. Minus: the axis the other way round; in "
            "planar and positional tasks on the other side of the end effector.",
        ),
    ] = None,
    count: Annotated[
        bool,
        typer.Option(
            "--count", help="Only print how many manipulators there are, and what is chosen."
        ),
    ] = False,
    convention: Annotated[
        str, typer.Option(metavar="NAME", help="dh: standard or modified.")
    ] = "standard",
    task: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="planar (2 rows), positional, planar-pose, rotational (3) or spatial (6).",
            show_default="by the number of rows",
        ),
    ] = None,
    kinds: Annotated[
        str | None,
        typer.Option(
            metavar="RP...",
            help="Revolute or prismatic, one letter per column.",
            show_default="from the columns",
        ),
    ] = None,
    length: Annotated[
        float,
        positive_option("L", "Metres per unit of linear velocity."),
    ] = 1.0,
    slide: Annotated[
        str | None,
        typer.Option(
            metavar="HOW",
            help="Slide joints along their axes: apart where links touch (as-needed), never, "
            "or to the least total length (length).",
            show_default="as-needed; never with a criterion other than clearance",
        ),
    ] = None,
    tolerance: Annotated[
        float,
        positive_option("TOL", "How far a column may be from one that a joint can contribute."),
    ] = 1e-6,
    pick: Pick = None,
    seed: Seed = 0,
    samples: Annotated[
        int,
        whole_option(1, "K", "Displacements that criteria sample."),
    ] = 100,
    shortlist: Annotated[
        int,
        whole_option(
            1,
            "K",
            "How many arms are judged by criteria that sample: the shortest, or those "
            "that a coarse sample finds best.",
        ),
    ] = 200,
    radius: Annotated[
        float,
        positive_option(
            "R", "Radius of the neighbourhood; of kept the half-width of artificial limits."
        ),
    ] = 0.2,
    size: Size = None,
    style: Style = None,
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
    from formulations.io.jacobians import only_jacobian
    from formulations.plot.style import looking
    from formulations.synthesis import from_jacobian
    from formulations.synthesis.choice import choose_arrangement, evaluate, given, rank
    from formulations.synthesis.criteria import Sampling
    from formulations.synthesis.links import link_gap, slide_apart
    from formulations.synthesis.links import slide as shortened
    from nlp.files import prepare_file, write_bytes, write_text

    if to not in forms.FORMS:
        raise InputError("--to", to, "one of " + ", ".join(forms.FORMS))
    if to != "figure":
        refuse_unused(context, ("size", "style"), f"--to {to}")
    if count:
        refuse_unused(context, ("out", "to", "convention", "size", "style"), "--count")
    elif as_json and to == "figure":
        raise InputError("--json", "given", "none with --to figure")
    elif to != "dh" and not as_json:
        refuse_unused(context, ("convention",), f"--to {to}")
    if slide is None:
        slide = "as-needed" if criterion in (None, "clearance") else "never"
    if slide not in SLIDES:
        raise InputError("--slide", slide, "one of " + ", ".join(SLIDES))
    arranged = order is not None or signs is not None
    if criterion is None:
        refuse_unused(context, ("shortlist", "ranking"), "no --criterion")
    if not (count or as_json or out is not None or criterion is not None):
        reason = "nothing that samples: --criterion, --count, --json and --out do"
        refuse_unused(context, ("samples", "radius"), reason)
        if arranged and slide != "as-needed":
            refuse_unused(context, ("seed",), reason)
    if out is not None and not count:
        prepare_file(out, inputs=[file, style])
    if ranking is not None:
        prepare_file(ranking, "--ranking", [file, style, *([out] if out else [])])
    looks = look(size, False, style)
    matrix = only_jacobian(file, pick)
    found = from_jacobian.realise(
        matrix, task=task, kinds=kinds, length=length, tolerance=tolerance
    )
    sampling = Sampling(seed, samples, radius)
    if criterion is not None and arranged:
        raise InputError("--criterion", criterion, "none with --order or --signs")
    if arranged:
        choice = given(found, _order(order), _flips(signs, found.joints), sampling)
    else:
        name = criterion or "clearance"
        ranked = rank(found, name, sampling, shortlist, show_progress)
        show_progress("")
        choice = choose_arrangement(found, name, sampling, shortlist, ranked)
        if ranking is not None:
            write_text(ranking, ranked.table().to_csv(index=False, lineterminator="\n"))
    moved = chosen = choice.manipulator
    if slide == "length":
        moved = shortened(chosen)
    elif slide == "as-needed" and link_gap(chosen).touching:
        moved = slide_apart(chosen, seed)
    if moved is not chosen:
        choice = replace(choice, manipulator=moved, values=evaluate(moved, sampling))
    deviation = from_jacobian.deviation(choice.manipulator, matrix, length)
    summary = forms.summary(choice, deviation, matrix) | {"slid": moved is not chosen}
    lines = as_text(forms.summary_lines(summary))
    note = forms.touching_note(summary)
    if note is not None:
        typer.echo(f"Note: {note}.", err=True)
    if count:
        typer.echo(json.dumps(summary, indent=1) if as_json else lines)
        return
    if as_json:
        everything = summary | forms.as_plain(choice.manipulator, convention)
        content = f"{json.dumps(everything, indent=1)}\n".encode()
    else:
        kind = "svg" if out is None else out.suffix.lower().removeprefix(".")
        with looking(looks):
            content = forms.write_down(choice.manipulator, to, convention, kind)
    if out is None:
        typer.echo(content, nl=False)
    else:
        write_bytes(out, content)
        typer.echo(lines)


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
