"""What ``lockedjoint bound`` prints where it is more than names and values."""

from collections.abc import Mapping
from typing import Any

from formulations.commands.output import as_text, shown


def rounded_outward(plain: Mapping[str, Any]) -> str:
    """Return the text with a bound that holds as it is shown."""
    from formulations.io.pages import outward

    limit = outward(plain["bound"], 9, lower=plain["quantity"] == "residual")
    return as_text({**plain, "bound": limit})


def without_multipliers(plain: Mapping[str, Any]) -> str:
    """Return the text of the bound (6) with the sharper bounds on record as a table."""
    from tabulate import tabulate

    from formulations.io.pages import outward

    left_out = ("multipliers", "sharper")
    text = as_text({name: v for name, v in plain.items() if name not in left_out})
    if not plain.get("sharper"):
        return text
    lines = [
        (
            f"{one['quantity']}, {one['model']}",
            "none exists" if one["value"] is None else outward(one["value"], 7, lower=False),
            one["kind"],
            shown(one["best_known"]),
            "–" if one["gap_percent"] is None else f"{one['gap_percent']:.2f}",
        )
        for one in plain["sharper"]
    ]
    heads = ("on record, sharper", "bound", "known by", "best found", "gap %")
    table = tabulate(lines, heads, tablefmt="pipe", disable_numparse=True)
    return f"{text}\n\n{table}\n\nThe gap is 100·|bound − found|/bound."


def existence_text(plain: Mapping[str, Any]) -> str:
    """Return the text of a relaxation of the existence question with its blocks as a table."""
    skipped = ("blocks", "free_moments", "certificate")
    summary = {k: v for k, v in plain.items() if k not in skipped}
    summary["free_moments"] = len(plain["free_moments"])
    for name, value in (plain["certificate"] or {}).items():
        summary[f"checked_{name}"] = value
    lines = [
        as_text(summary),
        "",
        "charge  representation   dimension  copies  size  margin alone",
    ]
    for block in plain["blocks"]:
        shape = "(" + ",".join(map(str, block["representation"])) + ")"
        alone = block["margin_alone"]
        margin = "–" if alone is None else f"{alone:+.6f}"
        verdict = "  infeasible alone" if block["infeasible_alone"] else ""
        size = f"{block['dimension']:>9}  {block['copies']:>6}  {block['size']:>4}"
        lines.append(f"{block['charge']:>6}  {shape:<15}  {size}  {margin:>12}{verdict}")
    return "\n".join(lines if plain["blocks"] else lines[:1])
