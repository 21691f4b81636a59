"""Records of a study as a table, whole or a part at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import pandas as pd

from formulations.campaign.columns import SCHEMA
from nlp.store import Store
from nlp.store_schema import Condition

BATCH = 20_000


def frame(
    store: Store, conditions: Sequence[Condition] = (), columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return the records that meet all conditions, one row each."""
    names = list(SCHEMA.columns if columns is None else columns)
    parts = list(batches(store, conditions, names))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=names)


def batches(
    store: Store, conditions: Sequence[Condition], columns: Sequence[str]
) -> Iterator[pd.DataFrame]:
    """Yield the records that meet all conditions some thousands at a time."""
    rows = store.rows(conditions, columns)
    while batch := list(islice(rows, BATCH)):
        yield pd.DataFrame(batch, columns=list(columns))
