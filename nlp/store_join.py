"""Statements that bring the records of one store into another, attached as ``other``."""

from __future__ import annotations

from collections.abc import Collection

from nlp.store_schema import Schema


def conflict_query(schema: Schema, apart_from: Collection[str]) -> str:
    """Return what finds a start that both stores have, with different values.

    Parameters
    ----------
    schema
        The columns of both.
    apart_from
        Values that may differ, such as times.
    """
    told = ", ".join(f"cell.{name}" for name in schema.settings)
    values = [name for name in schema.values if name not in apart_from]
    differ = " OR ".join(f"ours.{name} IS NOT theirs.{name}" for name in values) or "0"
    return (
        f"SELECT {told}, ours.start FROM other.record AS theirs {_cells(schema)} "
        "JOIN main.record AS ours ON ours.cell = cell.id AND ours.start = theirs.start "
        f"WHERE {differ} LIMIT 1"
    )


def join_statements(schema: Schema) -> list[str]:
    """Return what adds cells, environments and, last, records that are not there yet."""
    settings, values = ", ".join(schema.settings), ", ".join(schema.values)
    theirs = ", ".join(f"theirs.{name}" for name in schema.values)
    return [
        f"INSERT INTO main.cell ({settings}) SELECT {settings} FROM other.cell "
        "WHERE true ORDER BY id ON CONFLICT DO NOTHING",
        "INSERT INTO main.environment (environment) SELECT environment FROM other.environment "
        "WHERE true ORDER BY id ON CONFLICT DO NOTHING",
        f"INSERT INTO main.record (cell, start, environment, {values}) "
        f"SELECT cell.id, theirs.start, made.id, {theirs} "
        f"FROM other.record AS theirs {_cells(schema)} "
        "JOIN other.environment AS source ON source.id = theirs.environment "
        "JOIN main.environment AS made ON made.environment = source.environment "
        "WHERE true ORDER BY cell.id, theirs.start ON CONFLICT (cell, start) DO NOTHING",
    ]


def _cells(schema: Schema) -> str:
    """Join each of their records with our cell of the same settings."""
    same = " AND ".join(f"cell.{name} = source_cell.{name}" for name in schema.settings)
    return (
        "JOIN other.cell AS source_cell ON source_cell.id = theirs.cell "
        f"JOIN main.cell AS cell ON {same}"
    )
