"""What the reproduction shows, in a paragraph made from its rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from formulations.reproduction.row import Row, Verdict

_MEANING = {
    Verdict.AGREES: "agree",
    Verdict.MISPRINT: "are misprints, of which the corrected form is computed",
    Verdict.ROUNDED: "follow from rounded numbers",
    Verdict.IMPROVED: "are improved on",
    Verdict.MISMATCH: "are unexplained mismatches",
}


def finding(rows: Sequence[Row]) -> str:
    """Return the paragraph; empty if there is nothing to say."""
    counts = Counter(Verdict(row.verdict) for row in rows)
    parts = []
    for verdict, meaning in _MEANING.items():
        if counts[verdict]:
            which = "" if verdict is Verdict.AGREES else f" ({_equations(rows, verdict)})"
            parts.append(f"{counts[verdict]} {meaning}{which}")
    if not parts:
        return ""
    return f"Of {len(rows)} numbers and claims of the paper, {'; '.join(parts)}."


def _equations(rows: Sequence[Row], verdict: Verdict) -> str:
    found = [row.equation for row in rows if Verdict(row.verdict) is verdict]
    return ", ".join(dict.fromkeys(found))
