"""``lockedjoint figure``: figures of what is computed."""

import json
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import (
    MOST_STARTS,
    Json,
    NoTitle,
    Pick,
    Seed,
    Size,
    Style,
    Workers,
    look,
    progress,
    refuse_unused,
    whole_option,
)
from formulations.commands.output import as_text
from nlp.errors import InputError


def figure(
    context: typer.Context,
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="figure-1, figure-3: of the paper, from computed robots. seven-axes: the 7R "
            "optimum. singular-values: before and after each failure. trade-off: isotropy "
            "against worst case. optima: where random starts end.",
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="Its name ends in .svg, .png or .pdf.")
    ],
    data: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the numbers shown there, as CSV."),
    ] = None,
    jacobian: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="seven-axes, singular-values: show this one (CSV, NPY, NPZ or JSON).",
            show_default="solved for",
        ),
    ] = None,
    pick: Pick = None,
    store: Annotated[
        Path | None,
        typer.Option(metavar="DB", help="optima: show the starts of this campaign."),
    ] = None,
    starts: Annotated[
        int | None,
        whole_option(
            1,
            "K",
            "Random starts of each problem.",
            MOST_STARTS,
            show_default="5; figure-3 100; optima 50",
        ),
    ] = None,
    seed: Seed = 0,
    workers: Workers = None,
    size: Size = None,
    no_title: NoTitle = False,
    style: Style = None,
    as_json: Json = False,
) -> None:
    """Draw a figure of results that are computed anew, or of data that are given.

    Takes seconds; trade-off and optima about a minute.
    """
    from formulations.io.jacobians import only_jacobian
    from formulations.plot.figures import kind
    from formulations.plot.picture import Request
    from formulations.plot.style import content, figure_class, kind_of, looking
    from nlp.executors import default_workers
    from nlp.files import prepare_file, write_bytes, write_text

    wanted, form = kind(name), kind_of(out)
    for option, value in (("jacobian", jacobian), ("store", store)):
        if value is not None and option not in wanted.takes:
            raise InputError(f"--{option}", str(value), f"none with {name}")
    if pick is not None and jacobian is None:
        raise InputError("--pick", pick, "none without --jacobian")
    for option, value in (("--jacobian", jacobian), ("--store", store)):
        if value is not None:
            refuse_unused(context, ("starts", "seed", "workers"), option)
    figure_class()
    prepare_file(out, inputs=[jacobian, store, style])
    if data is not None:
        prepare_file(data, "--data", [jacobian, store, style, out])
    looks = look(size, no_title, style)
    request = Request(
        starts=starts or wanted.starts,
        seed=seed,
        workers=workers or default_workers(),
        jacobian=None if jacobian is None else only_jacobian(jacobian, pick),
        store=store,
        progress=progress,
    )
    with looking(looks):
        picture = wanted.make(request)
        progress("")
        drawn = content(picture.figure, form)
    write_bytes(out, drawn)
    if data is not None:
        write_text(data, picture.table.to_csv(index=False, lineterminator="\n"))
    summary: dict[str, object] = {"figure": name, "file": str(out)}
    if jacobian is None and store is None:
        summary |= {"seed": seed, "starts": request.starts}
    if as_json:
        typer.echo(json.dumps(summary | {"rows": picture.rows()}, indent=1))
    else:
        typer.echo(as_text(summary))
