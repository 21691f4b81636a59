"""Bounds printed with few digits, so that they are still bounds."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal


def rounded_down(number: float, digits: int = 5) -> str:
    """Return a number with so many decimals that is not above it."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-digits), ROUND_FLOOR))


def rounded_up(number: float, digits: int = 5) -> str:
    """Return a number with so many decimals that is not below it."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-digits), ROUND_CEILING))
