"""How to look for a posture: what is optimised, and from how many starts.

`Search` only holds and checks the settings; `posture_search` uses them. The command line has an
option for each parameter, and shows what its docstring says: `commands.vocabulary` has the rest
of these texts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.nlp.errors import of_kind, one_of

if TYPE_CHECKING:
    from lockedjoint.formulations.measures.unequal_failures import FailureModel
    from lockedjoint.formulations.registry import Formulation


@dataclass(frozen=True, repr=False)
class Search(Brief):
    """How to look for a posture.

    Parameters
    ----------
    formulation
        What is optimised: residual, max-min, isotropy, manipulability or condition, or one that
        was registered.
    failures
        How many joints lock at once; or a `FailureModel`, how likely each failure is.
    maximise
        What max-min maximises where failures have unequal probabilities: worst, the least of
        σ·(largest probability)/(probability) over the failures, or expected, the mean of σ
        weighted with the probabilities.
    starts
        Random starts of each problem; by default 100 to 6400, until it is unlikely that a
        better posture was missed.
    seed
        Random seed; reproducible across machines.
    workers
        Worker processes.
    ipopt
        Options of Ipopt, such as max_iter=500, over the formulation's own.
    progress
        Whether to show a progress bar.
    probabilities_known
        Whether the probabilities mean anything beyond their ratios.

    Raises
    ------
    InputError
        If a value is out of range.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Search(formulation="residual", starts=20)
    <Search: formulation residual, starts 20>
    """

    formulation: str | Formulation = "max-min"
    failures: int | FailureModel = 1
    maximise: str = "worst"
    starts: int | None = None
    seed: int = 0
    workers: int = 1
    ipopt: Mapping[str, object] = field(default_factory=dict)
    progress: bool = False
    probabilities_known: bool = True

    def __post_init__(self) -> None:
        from lockedjoint.formulations.max_min import GOALS
        from lockedjoint.nlp.arrays import whole_number

        for name in ("seed", "workers"):
            whole_number(name, getattr(self, name), 0 if name == "seed" else 1)
        if self.model is None:
            whole_number("failures", self.failures, 1)
        if self.starts is not None:
            whole_number("starts", self.starts, 1)
        for name in ("progress", "probabilities_known"):
            of_kind(name, getattr(self, name), bool, "true or false")
        of_kind("ipopt", self.ipopt, Mapping, "a mapping from names of options to values")
        one_of("maximise", self.maximise, GOALS)

    @property
    def model(self) -> FailureModel | None:
        """How likely each failure is; None if all joints are alike."""
        from lockedjoint.formulations.measures.unequal_failures import FailureModel

        return self.failures if isinstance(self.failures, FailureModel) else None

    @property
    def failure_count(self) -> int:
        """How many joints lock at once."""
        given: Any = self.failures
        return int(given if self.model is None else self.model.failures)

    @property
    def stated(self) -> Formulation:
        """The formulation itself, from its name or as it was given."""
        from lockedjoint.formulations.registry import formulation_of

        return formulation_of(self.formulation)
