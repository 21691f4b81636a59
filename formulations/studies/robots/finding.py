"""What the survey of robots shows, in a paragraph made from its rows."""

from __future__ import annotations

from collections.abc import Sequence

from formulations.studies.robots.survey import SurveyRow


def finding(rows: Sequence[SurveyRow]) -> str:
    """Return the paragraph; empty if there is nothing to say."""
    said = []
    six = [one for one in rows if one.task_dimension == 6]
    seven = [one for one in six if (one.joints, one.prismatic) == (7, 0)]
    if seven:
        best = max(seven, key=lambda one: one.percent_of_best_7r)
        worst = min(seven, key=lambda one: one.percent_of_best_7r)
        said.append(
            f"Of {len(seven)} arms with seven revolute joints in six dimensions, {best.arm} "
            f"comes nearest to the best 7R, with {best.percent_of_best_7r:.1f} % of its worst "
            f"case, and {worst.arm} keeps the least, {worst.percent_of_best_7r:.1f} %."
        )
    full = [one for one in six if one.joints > 7]
    if full:
        best = max(full, key=lambda one: one.percent_of_bound)
        said.append(
            f"Of those with more joints {best.arm} is the best, with "
            f"{best.percent_of_bound:.1f} % of the bound and {best.percent_of_best_7r:.1f} % "
            "of what the best 7R can do."
        )
    idle = [one for one in rows if one.mid_range_sigma < 1e-9]
    if rows:
        said.append(
            f"Midway between the joints' limits, {len(idle)} of the {len(rows)} tolerate no "
            "failure at all: the posture is what makes an arm failure tolerant."
        )
    return " ".join(said)
