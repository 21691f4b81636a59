"""Bounds as text: rounded to the side on which they still hold."""

from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

# Number of decimals of a bound where a caller names none.
_DECIMALS = 5


def rounded_down(number: float, decimals: int = _DECIMALS) -> str:
    """Return a number with so many decimals that is not above it: still a lower bound."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-decimals), ROUND_FLOOR))


def rounded_up(number: float, decimals: int = _DECIMALS) -> str:
    """Return a number with so many decimals that is not below it: still an upper bound."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-decimals), ROUND_CEILING))


def outward(number: float, digits: int, *, lower: bool) -> str:
    """Return a lower bound rounded down, or an upper one up, to so many significant digits."""
    decimals = digits - 1 - Decimal(number).adjusted() if number else 0
    text = (rounded_down if lower else rounded_up)(number, decimals)
    return f"{Decimal(text).normalize():f}"
