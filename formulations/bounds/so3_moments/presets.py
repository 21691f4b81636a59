"""Which row sectors each preset takes, and how it is solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    degree_sectors,
    without_repetition,
)
from nlp.errors import InputError


@dataclass(frozen=True)
class Preset:
    """A choice of rows.

    Parameters
    ----------
    name
        Its name.
    sectors
        The row sectors.
    solver
        The solver that suits its size.
    """

    name: str
    sectors: tuple[RowSector, ...]
    solver: str


_DEGREE_4 = degree_sectors(4, range(3))


def _preset(name: str, further: list[RowSector], solver: str) -> Preset:
    return Preset(name, without_repetition(_DEGREE_4 + further), solver)


# Rows of degree below 6 give no more than 0 for seven joints; total spin 1 is needed.
RESIDUAL_PRESETS: Mapping[str, Preset] = {
    preset.name: preset
    for preset in (
        _preset("low", [], "CLARABEL"),
        _preset(
            "fast",
            [RowSector(k, c, 0, 6) for k in (0, 4, 6) for c in (0, 2)]
            + [RowSector(k, c, 1, 6) for k in (0, 6) for c in (0, 2)],
            "predictor-corrector",
        ),
        _preset(
            "compact",
            [RowSector(2, 0, 0, 6), RowSector(6, 0, 0, 6), RowSector(2, 0, 1, 6)],
            "predictor-corrector",
        ),
        _preset("tight", degree_sectors(6, range(2)), "predictor-corrector"),
    )
}


def residual_preset(name: str) -> Preset:
    """Return a preset of the residual bound by its name.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    if name not in RESIDUAL_PRESETS:
        raise InputError("preset", name, ", ".join(RESIDUAL_PRESETS))
    return RESIDUAL_PRESETS[name]
