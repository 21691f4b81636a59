"""``lockedjoint figure``: figures of what is computed."""

from pathlib import Path

import typer

from formulations.commands import arguments as cli
from formulations.commands.arguments import option
from formulations.commands.output import as_text, progress, show
from nlp.errors import InputError


def figure(
    *,
    name: str = typer.Argument(
        metavar="NAME",
        help="figure-1, figure-3: of the paper, from computed robots. seven-axes: the 7R "
        "optimum. singular-values: before and after each failure. trade-off: isotropy "
        "against worst case. optima: where random starts end.",
    ),
    out: Path = option("FILE", "The figure's file; its name ends in .svg, .png or .pdf.", ...),
    data: Path | None = option("FILE", "Write the numbers that are shown there, as CSV."),
    jacobian: Path | None = option(
        "FILE",
        "Of seven-axes and singular-values: the Jacobian to show (CSV, NPY, NPZ or JSON); by "
        "default it is solved for.",
    ),
    pick: cli.Pick = None,
    store: Path | None = option("DB", "Of optima: show the starts of this campaign."),
    starts: int | None = option(
        "K",
        "Random starts of each problem; by default 5, figure-3 100, optima 50.",
        low=1,
        high=cli.MOST_STARTS,
    ),
    seed: cli.Seed = 0,
    workers: cli.Workers = None,
    look_options: cli.FigureOptions,
    as_json: cli.Json = False,
) -> None:
    """Draw a figure of results that are computed anew, or of data that are given.

    Takes seconds; trade-off and optima about a minute.
    """
    from formulations.io.files import prepare_file, write_bytes, write_text
    from formulations.measures.read_jacobians import only_jacobian
    from formulations.plot.figures import kind
    from formulations.plot.picture import Request
    from formulations.plot.style import content, figure_class, kind_of, looking
    from nlp.executors import default_workers

    wanted, form = kind(name), kind_of(out)
    for given, value in (("jacobian", jacobian), ("store", store)):
        if value is not None and given != wanted.takes:
            raise InputError(f"--{given}", str(value), f"none with {name}")
    if pick is not None and jacobian is None:
        raise InputError("--pick", pick, "none without --jacobian")
    figure_class()
    prepare_file(out, inputs=[jacobian, store, look_options.style])
    prepare_file(data, "--data", [jacobian, store, look_options.style, out])
    look = look_options.look()
    request = Request(
        starts=starts or wanted.starts,
        seed=seed,
        workers=workers or default_workers(),
        jacobian=None if jacobian is None else only_jacobian(jacobian, pick)[1],
        store=store,
        progress=progress,
    )
    with looking(look):
        picture = wanted.make(request)
        drawn = content(picture.figure, form)
    write_bytes(out, drawn)
    if data is not None:
        write_text(data, picture.table.to_csv(index=False, lineterminator="\n"))
    summary: dict[str, object] = {"figure": name, "file": str(out)}
    if jacobian is None and store is None:
        summary |= {"seed": seed, "starts": request.starts}
    show(summary | {"rows": picture.rows()}, as_json, lambda _: as_text(summary))
