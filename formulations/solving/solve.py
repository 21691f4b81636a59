"""One formulation on one arm from many starts: the main entry point of the library."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import registry
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel, Joint
from lockedjoint.formulations.registry import Formulation
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.outcome import Outcome, PolishMethod, judge
from lockedjoint.nlp.arrays import FloatArray, Rng, whole_number
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.nlp.executors import default_workers
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.starts import seed_of

#: What draws a start from a random generator; or the starts, shape (starts, variables).
Sampler = Callable[[np.random.Generator], FloatArray] | npt.ArrayLike
# Numbers of joints and of task dimensions where only a kind of joint is named: the paper's.
_JOINTS = 7
_TASK_DIMENSIONS = 6


def solve(
    formulation: str | Formulation = "max-min",
    arm: str | ArmModel | Sequence[Joint] = "unit-revolute",
    joints: int | None = None,
    task_dimension: int | None = None,
    *,
    starts: int = 100,
    seed: Rng | None = None,
    rng: Rng | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    solver: str = "ipopt",
    options: Mapping[str, object] | None = None,
    progress: bool = False,
    **settings: Any,
) -> Outcome:
    """Solve a formulation from random starts and judge every answer from its J alone.

    Parameters
    ----------
    formulation
        ``"residual"``, ``"max-min"``, ``"isotropy"``, ``"manipulability"``, ``"condition"``,
        the name of one that was registered, or any object with the names of `Formulation`.
    arm
        Any `ArmModel`: an `Arm` of joints to be designed, or a `RobotArm`. Also a row of
        joints, or their kind by its name in `lockedjoint.formulations.joints.models`, or a mix
        such as ``"lever-revolute(length=0.3):6,prismatic:2"``.
    joints, task_dimension
        Numbers n of joints and m of task dimensions, n > m. By default those of the arm or
        of the mix; 7 and 6 where only a name is given.
    starts
        How many random starts, at least 1.
    seed, rng
        Random seed, 0 by default; reproducible across machines and numbers of workers. Or a
        generator from which one is drawn. Two names for the same.
    workers, executor
        Where to run; see `lockedjoint.nlp.multistart.multistart`. By default one process per
        processor core.
    solver, options
        Of the solver; see `lockedjoint.nlp.multistart.multistart`. Options go over the
        problem's own; Ipopt's ``max_wall_time`` limits the seconds of a start.
    progress
        Whether to show a bar.
    **settings
        Of the formulation. Of max-min: ``failures``, how many joints lock at once, or a
        `FailureModel`, and ``maximise``, ``"worst"`` or ``"expected"``; ``largest_defect`` of
        isotropy; ``encoding`` and ``from_residual_minima``, see
        `lockedjoint.formulations.max_min`. Of the others but residual: ``failures``.

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

    Examples
    --------
    >>> import lockedjoint as lj
    >>> outcome = lj.solve("max-min", "unit-revolute", joints=7, starts=5, workers=1)
    >>> print(f"{outcome.best.score:.6f}")
    0.571483
    >>> outcome.best.jacobian.shape
    (6, 7)
    """
    of_kind("progress", progress, bool, "true or false")
    case = Case(
        registry.formulation_of(formulation),
        arm_of(arm, joints, task_dimension),
        {name: value for name, value in settings.items() if value is not None},
        options={} if options is None else options,
        solver=solver,
    )
    return run(
        case,
        starts=starts,
        seed=seed_of(seed, rng),
        workers=default_workers() if workers is None else workers,
        executor=executor,
        progress=progress,
    )


def arm_of(
    arm: str | ArmModel | Sequence[Joint],
    joints: int | None = None,
    task_dimension: int | None = None,
) -> ArmModel:
    """Return the arm that an argument stands for; see `solve`."""
    if isinstance(arm, str):
        count = _JOINTS if joints is None and ":" not in arm else joints
        rows = _TASK_DIMENSIONS if task_dimension is None else task_dimension
        return models.arm(arm, count, rows)
    built: Any = arm
    if isinstance(arm, Sequence) and all(isinstance(joint, Joint) for joint in arm):
        row: Any = arm
        built = Arm(tuple(row))
    if isinstance(built, type) or not (hasattr(built, "matrix") and hasattr(built, "admits")):
        raise InputError("arm", repr(arm), "a name, an Arm, a RobotArm or a row of joints")
    m, n = built.shape
    for argument, given, own in (("joints", joints, n), ("task dimension", task_dimension, m)):
        if given is not None and whole_number(argument, given, 1) != own:
            raise InputError(argument, given, f"{own}, as the joints have, or none")
    model: ArmModel = built
    return model


def run(
    case: Case,
    *,
    starts: int | None = None,
    first: int = 0,
    seed: int = 0,
    workers: int = 1,
    executor: Executor | None = None,
    progress: bool = False,
    sample: Sampler | None = None,
    polish: PolishMethod | None = None,
) -> Outcome:
    """Solve a case from all starts, see `multistart`, and `judge` what comes out.

    Starts are drawn as the case says, the same for all cases of one arm; or `sample` has them,
    or draws them. `polish` improves each answer before it is judged. With `progress` a bar is
    shown.
    """
    study = multistart(
        case.build,
        case.sample if sample is None else sample,
        starts=starts,
        first=first,
        seed=seed,
        workers=workers,
        executor=executor,
        options=case.options,
        solver=case.solver,
        label=case.name if progress else None,
        judge=lambda run: judge(case, run, polish),
        figure=lambda record: record.score,
        better=np.fmin if case.formulation.SENSE == "minimise" else np.fmax,
    )
    return Outcome(case, study.results, study.complete)
