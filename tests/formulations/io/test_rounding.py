"""Bounds as text still hold."""

from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.io.rounding import rounded_down, rounded_up


@given(st.floats(1e-3, 10), st.integers(2, 9))
def test_rounded_bounds_are_still_bounds(number, digits):
    unit = 1.000001 * 10.0**-digits
    assert number - unit < float(rounded_down(number, digits)) <= number
    assert number <= float(rounded_up(number, digits)) < number + unit
