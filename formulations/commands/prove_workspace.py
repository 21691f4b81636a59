"""``lockedjoint prove-workspace``: positions that are kept for certain after any failure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from formulations.commands.arguments import FigureOptions, Seed, Workers, flag, option
from formulations.commands.output import Answer, progress
from formulations.commands.robot_arguments import ChainOptions, LimitOptions, chosen_limits

_ENDING = ".npz"


def prove_workspace(
    robot: ChainOptions,
    limits: LimitOptions,
    *,
    finest: float | None = option(
        "METRES",
        "Edge of the smallest cubes; by default a hundredth of the sum of the links.",
        positive=True,
    ),
    halvings: int = option(
        "K", "How often cubes that are not proved are halved.", 3, low=0, high=12
    ),
    above: bool = flag(
        "--above",
        "Also prove of cubes that they are lost: a bound from above. For planar arms; of "
        "others it is weak.",
    ),
    out: Path | None = option("FILE", "Write the cubes there: NPZ, which `verify` reads."),
    figure: Path | None = option("FILE", "Draw the cubes: SVG, PNG or PDF."),
    figure_options: FigureOptions,
    workers: Workers = None,
    seed: Seed = 0,
) -> Answer:
    """Prove that cubes of positions are kept, whichever joint locks and wherever.

    A position is kept as for `workspace`, but here neither positions nor locked angles are
    sampled: the volume is a lower bound, rounding errors included. The search goes through the
    arm's reach group by group; after Ctrl-C, what has been proved is shown and written.
    Collisions are not checked.
    """
    from formulations.io.files import prepare_file, write_bytes
    from formulations.kinematics.serial_arm import SerialArm
    from formulations.plot.robots import draw_kept
    from formulations.plot.style import content, kind_of, looking
    from formulations.workspaces.guaranteed import guaranteed_workspace
    from formulations.workspaces.kept_cubes import KeptCubes, LostCubes
    from formulations.workspaces.lost_cubes import cubes_around, lost_cubes
    from nlp.errors import InputError
    from nlp.executors import LocalExecutor, default_workers

    if out is not None and out.suffix != _ENDING:
        raise InputError("--out", out, f"a file that ends in {_ENDING}")
    form = kind_of(figure) if figure else ""
    look = figure_options.look()
    prepare_file(figure, "--figure", [robot.file, figure_options.style])
    prepare_file(out, inputs=[robot.file, figure])
    arm = SerialArm.from_chain(robot.chain())
    ranges = chosen_limits(limits.read(), arm)
    edge = finest or float(sum(arm.links)) / 100
    if above:  # what is refused is better known before an hour's work
        cubes_around(arm, ranges, edge / 2, halvings)
    parts: list[KeptCubes] = []
    lost: list[LostCubes] = []
    status = 0
    with LocalExecutor(workers or default_workers()) as executor:
        found = guaranteed_workspace(
            *(arm, ranges, edge / 2, halvings), seed=seed, executor=executor, progress=progress
        )
        try:
            parts.extend(found)
            if above:
                given = (KeptCubes.joined(parts), edge / 2, halvings)
                lost.extend(lost_cubes(*given, executor=executor, progress=progress))
        except KeyboardInterrupt:
            status = 130
    cubes = KeptCubes.joined(parts) if parts else None
    if cubes and lost:
        cubes = replace(cubes, lost=LostCubes.joined(lost))
    size = cubes.size if cubes else 0.0
    values = {
        "kept_for_certain": size,
        **({"at_most": cubes.at_most} if cubes and cubes.lost else {}),
        "unit": "m²" if arm.is_planar else "m³",
        "cubes": len(cubes.width) if cubes else 0,
        "edges": sorted({2 * width for width in cubes.width.tolist()}) if cubes else [],
        "kind": "proved, rounding errors included",
        "complete": status == 0,
        "limits": {step.name: list(ends) for step, ends in zip(arm.steps, ranges, strict=True)},
    }
    failure = ["Interrupted: what was proved until then is above."] if status else []
    if not size:
        failure.append(
            "Nothing was proved to be kept: try other --limits, or a smaller --finest."
        )
        return Answer(values, failure=failure, status=status or 1)
    if out is not None and cubes is not None:
        write_bytes(out, cubes.to_bytes())
    if figure is not None and cubes is not None:
        with looking(look):
            write_bytes(figure, content(draw_kept(cubes), form))
    return Answer(values, failure=failure, status=status)
