"""One formulation on one arm from many starts: the main entry point of the library."""

from collections.abc import Mapping, Sequence
from functools import partial

from formulations import catalogue
from formulations.catalogue import arm
from formulations.joints.arm import Arm
from formulations.joints.joint import Joint
from formulations.measures.unequal_failures import FailureModel
from formulations.solving.outcome import Outcome
from formulations.solving.record import judge
from formulations.solving.setup import Setup, solver_options
from formulations.unequal_max_min import Goal
from nlp.arrays import Rng
from nlp.errors import InputError
from nlp.multistart import default_workers, multistart
from nlp.task import seed_of


def solve(
    formulation: str = "max-min",
    model: str | Arm | Sequence[Joint] = "unit-revolute",
    joints: int | None = None,
    task_dimension: int | None = None,
    *,
    starts: int = 100,
    rng: Rng = 0,
    workers: int | None = None,
    locked: int = 1,
    failures: FailureModel | None = None,
    goal: Goal = "worst",
    encoding: str | None = None,
    from_residual_minima: bool = False,
    solver: str = "ipopt",
    options: Mapping[str, object] | None = None,
    compiled: bool = False,
    time_limit: float | None = None,
    progress: bool = False,
) -> Outcome:
    """Solve a formulation from random starts and judge every answer from its J alone.

    Parameters
    ----------
    formulation
        ``"residual"``, ``"max-min"`` or ``"isotropy"``.
    model
        The joints: an arm, a row of joints, or their column model by its name in
        `formulations.catalogue.MODELS`, or a mix such as
        ``"lever-revolute(length=0.3):6,prismatic:2"``.
    joints, task_dimension
        Numbers n of joints and m of task dimensions, n > m. By default those of the joints or
        of the mix; 7 and 6 where only a name is given.
    starts
        How many random starts, at least 1.
    rng
        A seed, or a generator from which one is drawn. Start k of a seed is the same on every
        machine and for any number of workers.
    workers
        Processes; by default one per processor core.
    locked, failures, goal, encoding, from_residual_minima
        Of max-min; see `Setup`. By default the encoding that suits the failures.
    solver, options, compiled, time_limit
        Of the solver; see `nlp.multistart.multistart`. Options go over the formulation's own.
    progress
        Whether to show a bar.

    Returns
    -------
    Outcome
        Every record; `best`, `reached`, `verdict`, `to_frame()`.

    Raises
    ------
    InputError
        If an argument is not allowed.
    SolverOptionError
        If the solver does not know an option.
    WorkerError
        If worker processes die or hang.
    """
    if encoding is not None and "encoding" not in catalogue.formulation(formulation).SETTINGS:
        raise InputError("encoding", encoding, f"none for the formulation {formulation}")
    name, joints, task_dimension = _stated(model, joints, task_dimension)
    setup = Setup(
        formulation,
        name,
        encoding=encoding or "",
        from_residual_minima=from_residual_minima,
        locked=locked,
        failures=failures,
        goal=goal,
    )
    return run(
        setup,
        joints=joints,
        task_dimension=task_dimension,
        starts=starts,
        seed=seed_of(rng),
        workers=workers or default_workers(),
        options=options,
        solver=solver,
        compiled=compiled,
        time_limit=time_limit,
        progress=progress,
    )


def _stated(
    model: str | Arm | Sequence[Joint], joints: int | None, task_dimension: int | None
) -> tuple[str, int, int]:
    """Return the model's name, n and m."""
    if isinstance(model, str):
        bare = ":" not in model
        count = 7 if joints is None and bare else joints
        shape = arm(model, count, 6 if task_dimension is None else task_dimension).shape
        return model, shape[1], shape[0]
    row = model.joints if isinstance(model, Arm) else model
    if not isinstance(row, Sequence) or not all(isinstance(one, Joint) for one in row):
        raise InputError("model", repr(model), "a name, an Arm or a row of joints")
    built = Arm(tuple(row))
    m, n = built.shape
    for argument, given, own in (("joints", joints, n), ("task dimension", task_dimension, m)):
        if given not in (None, own):
            raise InputError(argument, given, f"{own}, as the joints have, or none")
    return catalogue.model_of(built), n, m


def run(
    setup: Setup,
    *,
    joints: int,
    task_dimension: int,
    starts: int,
    seed: int,
    workers: int,
    options: Mapping[str, object] | None = None,
    solver: str = "ipopt",
    compiled: bool = False,
    time_limit: float | None = None,
    progress: bool = False,
) -> Outcome:
    """Solve from all starts and judge what comes out.

    Start k is the same for all setups on one model. Parameters are those of
    `nlp.multistart.multistart`; `options` go over the formulation's own.
    """
    built = arm(setup.model, joints, task_dimension)
    label = " ".join(filter(None, (setup.formulation, setup.model, setup.variant)))
    study = multistart(
        setup.build(joints, task_dimension),
        setup.sample(built),
        starts=starts,
        rng=seed,
        workers=workers,
        options=solver_options(setup.formulation, solver, options or {}, setup.encoding),
        solver=solver,
        compiled=compiled,
        time_limit=time_limit,
        label=label if progress else None,
        judge=partial(judge, arm=built, merit=setup.merit(), locked=setup.locked),
        figure=lambda record: record.merit,
    )
    return Outcome(setup, built, study.results, study.complete)
