"""The forms a manipulator can be written in: axes, Denavit–Hartenberg, URDF, figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from formulations.realise.choice import Choice
from formulations.realise.dh import Convention, denavit_hartenberg
from formulations.realise.drawing import render
from formulations.realise.manipulator import Manipulator
from formulations.realise.report import axes_text, dh_text
from formulations.realise.write_urdf import urdf
from nlp.errors import InputError

FORMS = ("axes", "dh", "urdf", "figure")


def write_down(manipulator: Manipulator, form: str, convention: str, figure_kind: str) -> bytes:
    """Return a manipulator in one of the `FORMS`, as the content of a file.

    Parameters
    ----------
    manipulator, form
        What, and how.
    convention
        Of a ``dh`` table: ``standard`` or ``modified``.
    figure_kind
        Of a ``figure``: ``svg``, ``png`` or ``pdf``.

    Raises
    ------
    InputError
        If there is no such form, convention or kind of figure, or matplotlib is missing.
    """
    table = denavit_hartenberg(manipulator, _convention(convention))
    writers: Mapping[str, Callable[[], bytes]] = MappingProxyType(
        {
            "axes": lambda: f"{axes_text(manipulator)}\n".encode(),
            "dh": lambda: f"{dh_text(table)}\n".encode(),
            "urdf": lambda: urdf(manipulator).encode(),
            "figure": lambda: render(manipulator, figure_kind),
        }
    )
    if form not in writers:
        raise InputError("--to", form, "one of " + ", ".join(FORMS))
    return writers[form]()


def as_plain(choice: Choice, convention: str) -> dict[str, object]:
    """Return everything but the figure as plain values: axes, table and URDF."""
    chosen = choice.manipulator
    table = denavit_hartenberg(chosen, _convention(convention))
    return {**chosen.to_dict(), "dh": table.to_dict(), "urdf": urdf(chosen)}


def _convention(name: str) -> Convention:
    try:
        return Convention(name)
    except ValueError:
        allowed = "one of " + ", ".join(one.value for one in Convention)
        raise InputError("--convention", name, allowed) from None
