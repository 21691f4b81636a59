"""Which optima random starts end at, and the trade-off of worst case and isotropy.

Starts are counted by the worst case σ of the Jacobian J that they end at, measured from J
alone: the least singular value that a failure leaves. Those that do not pass the gate
(`Record.trusted`) are counted apart. The *isotropy defect* is ½‖JJᵀ − (T/m)I‖_F², where J has m
rows and T = ‖J‖_F². Nothing here has a unit but what names and comments say.

The rows of a `Picture` are, in `make`, one for each start, with the columns `COLUMNS`; in
`trade_off` one for each point of a curve, with its model, what `TradeOffPoint.to_dict` has, and
J as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lockedjoint.figures import style
from lockedjoint.figures.style import Picture, solved
from lockedjoint.formulations import isotropy, max_min, registry, residual
from lockedjoint.formulations.campaign.records import open_store
from lockedjoint.formulations.campaign.tables import SETTINGS, differing, frame, trusted
from lockedjoint.formulations.io.rounding import rounded_up
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.registry import Formulation
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.formulations.solving.outcome import Outcome
from lockedjoint.formulations.solving.trade_off_curve import trade_off_curve
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError, shown

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The width of the figure, in inches.
_WIDTH_INCHES = 8.4
# The height of a histogram with its label, in inches.
_ROW_INCHES = 0.9
# The height of the title and of the axis below all histograms, in inches.
_BESIDE_ROWS_INCHES = 0.9
# The number of bins of a histogram. More of them tell nearer optima apart, as thinner bars.
_BINS = 240
# Starts whose values differ by less than this are at one optimum: numbers are printed so.
_SAME = 1e-5
# The room at both sides of all values of σ: a share of their range, and at least so much.
_ROOM_SHARE = 0.03
_LEAST_ROOM = 1e-3
# The height of a histogram, as a factor of its highest bar: room for the number above it.
_HEADROOM = 1.5
# Optima are a continuum if they are more than this number, and more than the share below.
_FEW_OPTIMA = 3
# Optima are a continuum if they are more than this share of the starts.
_SCATTERED_SHARE = 0.2
# Labels of the two models.
_UNIT = "unit lever arms"
_LEVER = "free lever arms"
# Settings that every label of a store names.
_ALWAYS_NAMED = ("formulation", "model", "joints")
# The longest line above a histogram, in characters.
_LONGEST_LINE = 42
# Columns of a store's table that are shown of a start.
_SHOWN = ("start", "status", "worst_case_sigma", "isotropy_defect")
#: Columns of the rows, in their order: the problem on one line and as its label, the number of
#: the start, the solver's status, whether the start passed the gate, σ and the isotropy defect,
#: None where they are not known.
COLUMNS = ("problem", "label", *_SHOWN[:2], "counted", *_SHOWN[2:])
#: Problems that are solved if no store is given: the label of the histogram, and the case.
PROBLEMS = (
    (f"residual, {_UNIT}", Case(residual, arm("unit-revolute", 7))),
    (f"max-min, {_UNIT}", Case(max_min, arm("unit-revolute", 7))),
    (
        f"max-min, {_UNIT},\none factor per failure",
        Case(max_min, arm("unit-revolute", 7), {"encoding": "factor-per-deletion"}),
    ),
    (f"residual, {_LEVER}", Case(residual, arm("lever-revolute", 7))),
    (f"isotropy, {_LEVER}", Case(isotropy, arm("lever-revolute", 7))),
    (f"max-min, {_LEVER}", Case(max_min, arm("lever-revolute", 7))),
)


def make(effort: Effort, store: Path | None = None) -> Picture:
    """Solve from all starts, or read a campaign's store, and draw where they ended."""
    if store is not None:
        rows = stored(store)
    else:
        rows = [row for name, case in PROBLEMS for row in ends(name, solved(case, effort))]
    return Picture(draw(rows), rows)


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw a histogram for each problem of rows with the columns `COLUMNS`.

    style.NothingFoundError if no start passes the check.
    """
    sigmas = _counted(rows)
    if not sigmas:
        raise style.NothingFoundError("No start passes the check; ask for more starts.")
    names = list(dict.fromkeys(row["problem"] for row in rows))
    room = max(_ROOM_SHARE * np.ptp(sigmas), _LEAST_ROOM)
    edges = np.linspace(min(sigmas) - room, max(sigmas) + room, _BINS + 1)
    height_inches = _BESIDE_ROWS_INCHES + _ROW_INCHES * len(names)
    with style.styled(_WIDTH_INCHES, height_inches) as figure:
        figure.suptitle("Where random starts end, by the worst case σ")
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            _draw(axes, [row for row in rows if row["problem"] == name], edges)
        panels[-1].set_xlabel("worst-case σ, measured from J alone")
    return figure


def _counted(rows: Iterable[Mapping[str, Any]]) -> list[float]:
    """Return σ of the starts that passed the gate."""
    return [row["worst_case_sigma"] for row in rows if row["counted"]]


def levels(sigmas: Iterable[float]) -> list[tuple[float, int]]:
    """Return the σ of each optimum, best first, and how many starts ended there.

    An optimum has the best σ of its starts, and those up to `_SAME` below it.
    """
    optima: dict[float, int] = {}
    best = np.inf
    for sigma in sorted(sigmas, reverse=True):
        if best - sigma > _SAME:
            best = sigma
        optima[best] = optima.get(best, 0) + 1
    return list(optima.items())


def ends(label: str, outcome: Outcome) -> list[dict[str, Any]]:
    """Return where the starts of an outcome ended, one row each, with the columns `COLUMNS`."""
    return [
        {
            "problem": " ".join(label.split()),
            "label": label,
            "start": record.index,
            "status": record.status.return_status,
            "counted": record.trusted,
            "worst_case_sigma": _or_none(record.worst_case_sigma),
            "isotropy_defect": _or_none(record.isotropy_defect),
        }
        for record in outcome.records
    ]


def _or_none(number: float) -> float | None:
    """Return a number, None in place of NaN."""
    return None if np.isnan(number) else float(number)


def stored(path: Path) -> list[dict[str, Any]]:
    """Return one row per start of a campaign's store, labelled by the settings that differ.

    FileError if it holds no records, MissingLibraryError without pandas.
    """
    with open_store(path) as store:
        records = frame(store, columns=[*_SHOWN[1:], "valid", "violation"])
    if records.empty:
        raise FileError("store", str(path), "a store with records")
    named = differing(records, SETTINGS, _ALWAYS_NAMED, _ALWAYS_NAMED)
    labels = records[list(SETTINGS)].apply(_label, axis=1, named=named)
    counted = trusted(records) & np.isfinite(records["worst_case_sigma"])
    table = records[list(_SHOWN)].assign(label=labels, counted=counted)
    table = table.assign(problem=labels.str.split().str.join(" "))[list(COLUMNS)].astype(object)
    rows = table.where(table.notna(), None).to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in rows]


def _label(settings: pd.Series, named: list[str]) -> str:
    """Return the label of a problem from a record's settings.

    The first line has the statement and the arm; each setting that is `named` has another one.
    """
    first = f"{settings['formulation']}, {settings['joints']} × {settings['model']}"
    rest = [f"{name.replace('_', ' ')} {settings[name]}" for name in named if settings[name]]
    return "\n".join([shown(first), *(shown(line, _LONGEST_LINE) for line in rest)])


def _draw(axes: Axes, rows: Sequence[Mapping[str, Any]], edges: FloatArray) -> None:
    """Draw the histogram of one problem's rows; `edges` of the bins, shape (_BINS + 1,)."""
    optima = levels(_counted(rows))
    axes.set_title(str(rows[0]["label"]), fontsize=style.SMALL, **style.LITERAL)
    axes.set_title(_summary(optima, len(rows)), fontsize=style.SMALL, loc="right")
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.spines["bottom"].set_color(style.PALE)
    axes.tick_params(length=0)
    axes.margins(x=0)
    if optima:
        # All starts of one optimum in one bin: an edge may lie between their last digits.
        sigmas, reached = zip(*optima, strict=True)
        counts, _ = np.histogram(sigmas, edges, weights=reached)
        axes.stairs(counts, edges, fill=True, color=style.BLUE)
        peak = int(np.argmax(counts))
        place = float(edges[peak : peak + 2].mean()), counts[peak]
        number = axes.text(
            *place, f"{counts[peak]:.0f}", color=style.BLUE, fontsize=style.SMALL
        )
        number.set(ha="center", va="bottom")
        axes.set_ylim(0, _HEADROOM * counts[peak])


def _summary(optima: list[tuple[float, int]], starts: int) -> str:
    """Return in words how many of all starts ended where, and how many failed.

    `optima` are those of `levels`. For a few optima the text has the number at the best one,
    for a continuum the range of σ.
    """
    if not optima:
        return f"none of {starts}"
    best, reached = optima[0]
    counted = sum(number for _, number in optima)
    if len(optima) > max(_FEW_OPTIMA, _SCATTERED_SHARE * counted):
        text = f"{counted} of {starts} from {optima[-1][0]:.3f} to {best:.3f}"
    else:
        text = f"{reached} of {starts} at {best:.5f}"
        others = counted - reached
        text += f", {others} elsewhere" if others else ""
    lost = starts - counted
    return text + (f", {lost} fail" if lost else "")


# The legend of the trade-off has two columns in figures of this width or more.
_TWO_COLUMNS_INCHES = 6.0
# Width and height of the trade-off, in inches.
_TRADE_OFF_INCHES = (7.4, 4.8)
# The trade-off is wider than its curves by this factor.
_WIDER = 1.3
# The left end of the axis of the trade-off: markers at distance 0 are not cut.
_LEFT_END = -0.01
# The upper end of the line left of which there are no unit lever arms, as σ. Another value only
# makes the line longer or shorter.
_LINE_TOP_SIGMA = 0.517
# Proved bounds: a statement, its model, and the share of the width along which it is drawn.
_PROVED = (
    (max_min, "lever-revolute", 1.0),
    (max_min, "unit-revolute", 1.0),
    (isotropy, "lever-revolute", 0.12),  # at isotropic ones only, on the left
)
# Each curve has a name, a colour, and an offset in points where its largest σ is written.
_CURVES = {
    "unit-revolute": ("unit lever arms", style.BLUE, (5, -9)),
    "lever-revolute": ("free lever arms", style.VERMILION, (0, 8)),
}


def trade_off(effort: Effort, points: int = 12) -> Picture:
    """Draw the best σ over the distance from isotropy, a curve for each model.

    A curve has so many points: limits on the isotropy defect between its two ends.
    """
    curves = {model: _curve(model, effort, points) for model in _CURVES}
    rows = [row for curve in curves.values() for row in curve]
    seven = arm("unit-revolute", 7)
    with style.styled(*_TRADE_OFF_INCHES) as figure:
        axes = figure.subplots()
        axes.set_title("Seven revolute joints: what isotropy costs the worst case")
        for model, curve in curves.items():
            _draw_curve(axes, model, curve)
        right = _WIDER * float(_distance(rows).max())
        low = min(row["worst_case_sigma"] for row in rows)
        for statement, model, end in _PROVED:
            _draw_bound(axes, statement, model, right * end)
        # The residual of unit lever arms is half the square of their distance from isotropy.
        place = float(np.sqrt(2 * registry.bound(residual, seven).value))
        proved = "proved: no unit ones left of it"
        axes.vlines(place, low, _LINE_TOP_SIGMA, color=style.GREY, lw=0.6, label=proved)
        axes.set_xlabel("distance from isotropy ‖JJᵀ − (T/m)I‖, T = ‖J‖²")
        axes.set_ylabel("worst-case σ")
        axes.set_xlim(_LEFT_END, right)
        axes.margins(y=0.16)
        wide = figure.get_figwidth() >= _TWO_COLUMNS_INCHES
        figure.legend(loc="outside lower center", ncols=2 if wide else 1)
    return Picture(figure, rows)


def _distance(rows: Iterable[Mapping[str, Any]]) -> FloatArray:
    """Return ‖JJᵀ − (T/m)I‖_F of rows, from isotropy defects, which are half its square."""
    return np.asarray(np.sqrt([2 * row["isotropy_defect"] for row in rows]))


def _curve(model: str, effort: Effort, points: int) -> list[dict[str, Any]]:
    """Solve for the points of a model's curve; NothingFoundError if it has fewer than two."""

    def tell(what: str) -> None:
        effort.progress(f"{model}: {what}")

    curve = trade_off_curve(arm(model, 7), points, effort.starts or 1, effort.seed, tell)
    if len(curve) < 2:
        raise style.NothingFoundError(
            f"No start on {model} passes the check; ask for more starts."
        )
    return [
        {"model": model, **point.to_dict(), "jacobian": json.dumps(point.jacobian.tolist())}
        for point in curve
    ]


def _draw_bound(axes: Axes, statement: Formulation, model: str, end: float) -> None:
    """Draw what no Jacobian of a model passes, from exactly isotropic to an end."""
    bound = registry.bound(statement, arm(model, 7)).value
    name, colour, _ = _CURVES[model]
    asked = "isotropic, " if statement is isotropy else ""
    line = axes.hlines(bound, 0, end, color=colour, lw=0.9, ls=style.DASHED)
    line.set_label(f"proved bound, {asked}{name}: {rounded_up(bound)}")


def _draw_curve(axes: Axes, model: str, curve: Sequence[Mapping[str, Any]]) -> None:
    """Draw the rows of a model's curve, and write what its two ends are and their σ."""
    x, y = _distance(curve), np.array([row["worst_case_sigma"] for row in curve])
    name, colour, side = _CURVES[model]
    axes.plot(x, y, color=colour, lw=1.4, label=name)
    axes.plot(x[1:-1], y[1:-1], "o", ms=3, color=colour)
    axes.plot(x[[0, -1]], y[[0, -1]], "o", ms=6, color=colour, mec="white", mew=1)
    first = {"isotropy": "exactly isotropic", "residual": "residual minimum"}
    start = first[curve[0]["statement"]]
    style.beside(axes, (x[0], y[0]), f"{start} {y[0]:.5f}", (9, -4), colour)
    style.beside(axes, (x[-1], y[-1]), f"max-min {y[-1]:.5f}", side, colour)
