"""What was learned that the paper did not know: said only where the tables say so."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from formulations import isotropy, max_min, residual
from formulations.reproduction.row import Verdict
from formulations.studies.bounds.finding import sharpest
from formulations.studies.digits import rounded_down, rounded_up
from formulations.studies.tables import Tables

UNIT, LEVER = "unit-revolute", "lever-revolute"
# A gap below this, in percent, is none.
_CLOSED = 1e-4


def learned(tables: Tables) -> list[str]:
    """Return a paragraph for each thing learned, in Markdown."""
    return [text for what in _ALL for text in what(tables)]


def _existence(tables: Tables) -> Iterator[str]:
    facts = {fact.quantity: fact.value for fact in tables.existence}
    if facts.get("verdict") == "proved":
        verdicts = {row.order: row.verdict for row in tables.relaxations}
        relaxed = ", ".join(f"order {k} {verdict}" for k, verdict in verdicts.items())
        orders = f" The moment relaxations of the question: {relaxed}." if relaxed else ""
        yield (
            f"**No optimally failure-tolerant {facts['joints']}R Jacobian exists**: proved in "
            f"exact arithmetic, not merely not found.{orders}"
        )


def _one_minimum(tables: Tables) -> Iterator[str]:
    row = tables.plain(residual.NAME, UNIT, 7)
    if row is None or row.distinct_optima != 1:
        return
    text = (
        f"The residual minimum {row.objective:.6f} is *one* Jacobian: {row.reached_best} of "
        f"{row.starts} starts end at it, modulo frame, phase, order and signs."
    )
    numerical = sharpest(tables.bounds, residual.NAME, "numerical")
    rigorous = sharpest(tables.bounds, residual.NAME, "rigorous")
    if numerical is not None and numerical.gap_percent < _CLOSED:
        gap = row.objective - numerical.bound
        text += f" It is the global minimum to {gap:.0e}, numerically"
        text += (
            f"; rigorously nothing is below {rounded_down(rigorous.bound)}."
            if rigorous
            else "."
        )
    elif rigorous is not None:
        text += f" Rigorously, nothing is below {rounded_down(rigorous.bound)}."
    yield text


def _improvement(tables: Tables) -> Iterator[str]:
    before = tables.plain(residual.NAME, UNIT, 7)
    after, wider = (tables.plain(max_min.NAME, model, 7) for model in (UNIT, LEVER))
    if before is None or after is None or not after.gap_percent < before.gap_percent:
        return
    text = (
        f"'It is possible to slightly improve': from {before.gap_percent:.2f} % below the "
        f"bound (6) to {after.gap_percent:.2f} %, σ = {after.worst_case_sigma:.6f}"
    )
    if wider is not None and wider.gap_percent < after.gap_percent:
        text += (
            "; with free lever arms of the same mean square to "
            f"{wider.gap_percent:.2f} %, σ = {wider.worst_case_sigma:.6f}"
        )
    limits = [sharpest(tables.bounds, max_min.NAME, one) for one in ("rigorous", "numerical")]
    known = [limit for limit in limits if limit is not None]
    if known:
        passed = ", nor ".join(f"{rounded_up(limit.bound)}, {limit.kind}" for limit in known)
        left = ", ".join(f"{limit.gap_percent:.2f} % ({limit.kind})" for limit in known)
        text += f". No unit revolute 7R passes σ = {passed}: left to be found is at most {left}"
    yield f"{text}."


def _isotropy(tables: Tables) -> Iterator[str]:
    exact = tables.plain(isotropy.NAME, LEVER, 7)
    near = tables.plain(residual.NAME, UNIT, 7)
    best = tables.plain(max_min.NAME, UNIT, 7)
    if exact is None or near is None or best is None or exact.verdict != "solved":
        return
    if exact.worst_case_sigma < near.worst_case_sigma < best.worst_case_sigma:
        yield (
            "Isotropy and failure tolerance part ways at 7R. Exactly isotropic Jacobians do "
            "exist with free lever arms, but the best of them, σ = "
            f"{exact.worst_case_sigma:.6f}, tolerates failure worse than the nearly isotropic "
            f"one, {near.worst_case_sigma:.6f}, and that worse than max-min's, whose isotropy "
            f"defect is {best.isotropy_defect:.3f}."
        )


def _eight(tables: Tables) -> Iterator[str]:
    ours = {row.quantity: row.ours for row in tables.reproduction}
    around = ours.get("dimension of the family of 8R optima around (47)")
    own = [text for name, text in ours.items() if name.startswith("dimensions of the families")]
    if around and own:
        yield (
            f"The optimally failure-tolerant 8R come in families; dimensions found: {own[0]} "
            "starts. The paper's example (47) lies on one of dimension "
            f"{around.split(' ')[0]}, where the isotropy equations are rank deficient."
        )


def _misprints(tables: Tables) -> Iterator[str]:
    found = [row for row in tables.reproduction if Verdict(row.verdict) is Verdict.MISPRINT]
    if found:
        listed = "; ".join(f"{row.equation}, {row.quantity}" for row in found)
        yield f"Misprints in the paper, each computed both ways: {listed}."


def _any_jacobian(tables: Tables) -> Iterator[str]:
    for row in tables.reproduction:
        if row.equation == "(6)" and "any J" in row.quantity:
            if Verdict(row.verdict) is Verdict.AGREES:
                yield (
                    "The bound (6) holds for every Jacobian of the same ‖J‖, isotropic or "
                    "not, and has a counterpart for any number of locked joints "
                    "([docs/several_failures.md](../docs/several_failures.md))."
                )
            return


def _failures(tables: Tables) -> Iterator[str]:
    spared = [row for row in tables.failures if "never" in row.failing]
    enough = [row for row in spared if row.gap_percent < _CLOSED]
    if enough:
        row = enough[0]
        yield (
            f"With {row.failing} failing, unit revolute {row.joints}R reach their bound, "
            f"σ = {row.merit:.6f}: reliable joints make up for what all seven cannot do."
        )
    closed = [row for row in tables.failures if row.locked > 1 and row.gap_percent < _CLOSED]
    if closed:
        row = closed[0]
        yield (
            f"{row.locked} joints locked at once: the bound is attained by "
            f"{row.task_dimension}×{row.joints} free columns (an equiangular tight frame), "
            f"σ = {row.merit:.6f}."
        )


def _robots(tables: Tables) -> Iterator[str]:
    six = [row for row in tables.robots if row.task_dimension == 6]
    seven = [row for row in six if (row.joints, row.prismatic) == (7, 0)]
    if seven:
        best = max(seven, key=lambda row: row.percent_of_best_7r)
        least = min(seven, key=lambda row: row.percent_of_best_7r)
        yield (
            f"Of {len(seven)} arms of seven revolute joints that exist, none comes nearer to "
            f"the best 7R than {best.arm}, {best.percent_of_best_7r:.0f} % of its worst case "
            f"at the best posture found; {least.arm} keeps {least.percent_of_best_7r:.1f} %."
        )
    more = [row for row in six if row.joints > 7]
    passing = [row.arm for row in more if row.percent_of_best_7r > 100]
    if more:
        yield (
            f"Of {len(more)} arms with 8 to {max(row.joints for row in more)} joints "
            f"{len(passing)} pass what the best 7R could do"
            + (f": {'; '.join(passing)}." if passing else ".")
        )


_ALL: tuple[Callable[[Tables], Iterator[str]], ...] = (
    _existence,
    _one_minimum,
    _improvement,
    _isotropy,
    _any_jacobian,
    _eight,
    _failures,
    _robots,
    _misprints,
)
