"""The bounds as tables and as a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import pandas as pd

from formulations.files.provenance import header, versions
from formulations.studies.bounds.rows import BoundRow, ExistenceRow

_BOUNDS = {
    "quantity": "quantity",
    "joints": "n",
    "kind": "kind",
    "preset": "preset",
    "bound": "bound",
    "closed_form": "eq. (6)",
    "best_known": "best known",
    "gap_percent": "gap %",
    "moments": "moments",
    "largest_block": "largest block",
    "seconds": "seconds",
    "file": "file",
    "date": "date",
}
_RELAXATIONS = {
    "order": "order",
    "joints": "n",
    "classes": "classes of monomials",
    "equations": "linear equations",
    "rank": "their rank",
    "free_moments": "free moments",
    "largest_block": "largest block",
    "margin": "largest smallest eigenvalue",
    "proved": "proved of it",
    "verdict": "verdict",
    "infeasible_alone": "infeasible alone",
    "seconds": "seconds",
    "file": "file",
    "date": "date",
}
_FORMATS = {
    "bound": "{:.9g}",
    "closed_form": "{:.9g}",
    "best_known": "{:.9g}",
    "gap_percent": "{:.3g}",
    "margin": "{:+.7f}",
    "proved": "≤ {:+.7f}",
    "seconds": "{:.1f}",
}
_KINDS = """\
A bound on the residual is from below, on max-min and the worst case from above. *Numerical*:
floating point, but what is claimed is checked again from the solver's multipliers alone.
*Rigorous*: all rounding bounded under the standard model of double precision. How each comes
about is in [docs/bounds.md](../../docs/bounds.md). What made each file, with which versions, on
which machine and when, stands in the CSV tables; points are sampled with the seed above.
"""


def table(rows: Sequence[BoundRow] | Sequence[ExistenceRow]) -> pd.DataFrame:
    """All columns, one line per bound."""
    return pd.DataFrame([asdict(row) for row in rows])


def markdown(
    bounds: Sequence[BoundRow],
    relaxations: Sequence[ExistenceRow],
    seed: int,
    said: str,
) -> str:
    """Return the page: where it came from, what it shows, the tables, their commands."""
    rows: list[BoundRow | ExistenceRow] = [*bounds, *relaxations]
    commands = "\n".join(f"- `{row.file}`: `{row.command}`" for row in rows)
    solvers = versions(["cvxpy", "clarabel"])
    return (
        f"# Bounds\n\n{header({'seed': seed, 'solvers': solvers})}\n{said}\n\n{_KINDS}\n"
        f"{bounds_table(bounds)}\n\n"
        "Does an optimally failure-tolerant 7R Jacobian exist? The moment relaxation, exact\n"
        "in its equations, numerical in its eigenvalues:\n\n"
        f"{relaxations_table(relaxations)}\n\n"
        f"Each file by itself:\n\n{commands}\n"
    )


def bounds_table(rows: Sequence[BoundRow]) -> str:
    """Return the bounds on values as a Markdown table."""
    return _shown(rows, _BOUNDS)


def relaxations_table(rows: Sequence[ExistenceRow]) -> str:
    """Return the relaxations as a Markdown table."""
    return _shown(rows, _RELAXATIONS)


def _shown(
    rows: Sequence[BoundRow] | Sequence[ExistenceRow], columns: Mapping[str, str]
) -> str:
    lines = [[_cell(name, getattr(row, name)) for name in columns] for row in rows]
    frame = pd.DataFrame(lines, columns=list(columns.values()))
    return str(frame.to_markdown(index=False, disable_numparse=True))


def _cell(name: str, value: object) -> str:
    if value == "" or pd.isna(value):  # type: ignore[call-overload]
        return "–"
    return _FORMATS[name].format(value) if name in _FORMATS else str(value)
