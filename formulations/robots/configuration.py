"""Positions of a chain's joints, and of joints that are held, as a user writes them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from formulations.robots.chain import Chain, listed
from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError

_ALLOWED = "one number per joint, JOINT=VALUE pairs (both with commas), or a JSON file"


def read_configuration(text: str | None, chain: Chain) -> FloatArray:
    """Read a configuration.

    Parameters
    ----------
    text
        Numbers in the order of the chain's joints; or ``JOINT=VALUE`` pairs, the other
        joints staying midway between their limits; or the path of a ``.json`` file with a
        list, an object of positions by name, or an object with either under the key
        ``configuration``, as `lockedjoint posture` writes it. Midway if None.
    chain
        The joints.

    Returns
    -------
    numpy.ndarray
        Radians or metres, shape (n,), within the limits.

    Raises
    ------
    InputError
        If it is none of these, a joint is unknown, or a limit is passed.
    """
    if text is None:
        return chain.mid_range
    if text.lower().endswith(".json"):
        return _read_json(Path(text), chain)
    if "=" in text:
        return _by_name(pairs(text.split(",")), chain)
    return _in_order([number("--configuration", part) for part in text.split(",")], chain)


def pairs(settings: Sequence[str], name: str = "--configuration") -> dict[str, float]:
    """Read ``JOINT=VALUE`` settings; InputError if one is something else or repeated."""
    found: dict[str, float] = {}
    for setting in settings:
        joint, equals, value = (part.strip() for part in setting.partition("="))
        if not (joint and equals):
            raise InputError(name, setting, "JOINT=VALUE, radians or metres")
        if joint in found:
            raise InputError(name, f"{joint} twice", "every joint once")
        found[joint] = number(f"{name} of {joint}", value)
    return found


def number(name: str, value: object) -> float:
    """Return a finite number; InputError if it is none."""
    try:
        read = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        read = np.nan
    if isinstance(value, bool) or not np.isfinite(read):
        raise InputError(name, value, "a finite number, radians or metres")
    return read


def _read_json(path: Path, chain: Chain) -> FloatArray:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
        raise FileError("file", str(path), f"a file that can be read ({why})") from None
    except (ValueError, RecursionError) as reason:
        raise FileError("file", str(path), f"valid JSON ({reason})") from None
    if isinstance(content, dict) and "configuration" in content:
        content = content["configuration"]
    if isinstance(content, dict):
        named = {name: number(f"{name} in {path}", value) for name, value in content.items()}
        return _by_name(named, chain)
    if isinstance(content, list):
        return _in_order([number(f"an entry of {path}", value) for value in content], chain)
    raise FileError("file", str(path), "positions: a list, or an object by joint")


def _by_name(values: Mapping[str, float], chain: Chain) -> FloatArray:
    point = chain.mid_range
    for name, value in values.items():
        if name not in chain.names:
            raise InputError("joint", name, "one of " + listed(chain.names))
        point[chain.names.index(name)] = value
    return chain.within_limits(point)


def _in_order(values: Sequence[float], chain: Chain) -> FloatArray:
    if len(values) != len(chain.names):
        names = ", ".join(chain.names)
        allowed = f"{len(chain.names)} of them ({names}); or {_ALLOWED}"
        raise InputError("--configuration", f"{len(values)} numbers", allowed)
    return chain.within_limits(np.array(values))
