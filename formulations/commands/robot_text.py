"""An assessed robot as lines of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from formulations.commands.text import as_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from formulations.robots.characteristic_length import AtLength
    from formulations.robots.robot_assessment import Failure, RobotAssessment

# A singular value up to this is rounding.
_ROUNDING = 1e-12
# Failures shown, the worst first; the rest is in the JSON.
_SHOWN = 12


def robot_text(found: RobotAssessment, above: Mapping[str, object], source: str) -> str:
    """Return what was found: the robot, its posture, each failure, the dependence on ℓ.

    Parameters
    ----------
    found
        The assessment.
    above
        Named values to begin with.
    source
        Where the configuration is from, in words.
    """
    values = {
        **above,
        "robot": f"{found.robot}, from {found.base} to {found.tip}",
        "task": ", ".join(found.task) + (f" ({found.frame})" if found.frame == "tip" else ""),
        **({"held": _positions(found.held)} if found.held else {}),
        "configuration": f"{_positions(found.configuration)} ({source})",
        "at their limits": ", ".join(found.at_limits) or "none",
        "characteristic length": f"{found.characteristic_length:.6g} m",
        "worst-case sigma": _sigma(found.worst_case_sigma),
        "worst failure": _worst(found),
        "hurts most": _direction(found.worst_case_direction),
        "bound": f"{found.sigma_bound:.9g}, reached to {found.percent_of_bound:.2f} %",
        "reachable": f"{found.reachable_sigma:.9g}, reached to "
        f"{found.percent_of_reachable:.2f} %",
        "singular values": found.singular_values,
    }
    parts = [as_text(values), _failures(found.failures), _lengths(found)]
    return "\n\n".join(part for part in parts if part)


def _worst(found: RobotAssessment) -> str:
    joints = " and ".join(found.worst_case_joints)
    others = found.equally_bad - 1
    return f"{joints} ({others} more leave as little)" if others else joints


def _sigma(value: float) -> str:
    return f"{value:.6g}" if value > _ROUNDING else "0"


def _failures(failures: Sequence[Failure]) -> str:
    width = max(len(" and ".join(one.joints)) for one in failures)
    width = max(width, len("locked"))
    lines = [f"{'locked':<{width}}  sigma left   direction that suffers most"]
    for one in failures[:_SHOWN]:
        joints, direction = " and ".join(one.joints), _direction(one.direction)
        lines.append(f"{joints:<{width}}  {_sigma(one.sigma):<11}  {direction}")
    if len(failures) > _SHOWN:
        lines.append(f"… and {len(failures) - _SHOWN} failures that leave more")
    return "\n".join(lines)


def _lengths(found: RobotAssessment) -> str:
    if not found.by_length:
        return "The characteristic length is a mere unit here: percentages do not depend on it."
    lines = ["length (m)   sigma        % of bound   worst failure"]
    lines += [_length(one) for one in found.by_length]
    if found.best_length is not None:
        lines += ["best for this configuration:", _length(found.best_length)]
    return "\n".join(lines)


def _length(one: AtLength) -> str:
    joints, sigma = " and ".join(one.worst_case_joints), _sigma(one.worst_case_sigma)
    return f"{one.length:<11.4g}  {sigma:<11}  {one.percent_of_bound:<11.2f}  {joints}"


def _positions(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name}={value:.6g}" for name, value in values.items())


def _direction(values: Mapping[str, float]) -> str:
    return "  ".join(f"{name} {value:+.3f}" for name, value in values.items())
