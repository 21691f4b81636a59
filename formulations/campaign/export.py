"""Tables as CSV, Parquet, Markdown and LaTeX."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import pandas as pd

from formulations.campaign.columns import jacobian_of
from nlp.errors import InputError
from nlp.files import write_bytes, write_text

_DIGITS = {"merit": 8, "worst_case_sigma": 8, "isotropy_defect": 4}


def with_jacobians(records: pd.DataFrame) -> pd.DataFrame:
    """Return records with the Jacobian as JSON, every digit of it, in place of its bytes."""
    if "jacobian" not in records:
        return records
    shown = records.copy()
    parts = zip(records["jacobian"], records["task_dimension"], records["joints"], strict=True)
    shown["jacobian"] = [json.dumps(jacobian_of(raw, m, n).tolist()) for raw, m, n in parts]
    return shown


def as_csv(table: pd.DataFrame) -> str:
    """Return the table with every digit."""
    return table.to_csv(index=False)


def as_markdown(table: pd.DataFrame) -> str:
    """Return the table to read, matrices left out."""
    return str(_to_read(table).to_markdown(index=False, disable_numparse=True)) + "\n"


def as_latex(table: pd.DataFrame) -> str:
    """Return the table as a LaTeX tabular with booktabs' rules, matrices left out."""
    from tabulate import tabulate

    shown = _to_read(table)
    headers = [name.replace("_", " ") for name in shown.columns]
    cells = shown.to_numpy().tolist()
    text = tabulate(cells, headers, tablefmt="latex_booktabs", disable_numparse=True)
    return f"{text}\n"


def as_parquet(table: pd.DataFrame) -> bytes:
    """Return the table as a Parquet file's content.

    Raises
    ------
    InputError
        If pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        allowed = "csv, markdown or latex; or first run: pip install lockedjoint[parquet]"
        raise InputError("--to", "parquet", allowed) from None
    content = io.BytesIO()
    pq.write_table(pa.Table.from_pandas(table, preserve_index=False), content)
    return content.getvalue()


FORMATS: Mapping[str, Callable[[pd.DataFrame], str | bytes]] = MappingProxyType(
    {"csv": as_csv, "parquet": as_parquet, "markdown": as_markdown, "latex": as_latex}
)


def write(content: str | bytes, path: Path) -> None:
    """Write a table's text or bytes, whole or not at all; FileError if that fails."""
    if isinstance(content, bytes):
        write_bytes(path, content)
    else:
        write_text(path, content)


def _to_read(table: pd.DataFrame) -> pd.DataFrame:
    matrices = [name for name in ("jacobian", "canonical_form") if name in table]
    shown = table.drop(columns=matrices).astype(object)
    for name in shown.columns:
        shown[name] = [_cell(value, _DIGITS.get(name, 4)) for value in shown[name]]
    return shown


def _cell(value: object, digits: int) -> str:
    if isinstance(value, float):
        return "–" if pd.isna(value) else f"{value:.{digits}g}"
    return str(value)
