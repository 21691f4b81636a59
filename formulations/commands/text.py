"""Named values as aligned lines of text."""

from __future__ import annotations

from collections.abc import Mapping


def as_text(values: Mapping[str, object]) -> str:
    """Return one line per value, names aligned."""
    width = max(len(name) for name in values)
    return "\n".join(
        f"{name.replace('_', ' '):<{width}}  {shown(value)}" for name, value in values.items()
    )


def shown(value: object) -> str:
    """Return a value as a reader wants it: yes or no, nine digits, entries side by side."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {shown(entry)}" for name, entry in value.items())
    if isinstance(value, (list, tuple)):
        return "  ".join(shown(entry) for entry in value)
    return str(value)
