"""Tables of commands: what does not fit a terminal is broken where a reader expects it."""

from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.commands.output import WIDTH, as_table

# As wide as what a terminal leaves beside a broken column.
NOTE = "n" * 54


def names(table):
    """Return the lines of the first column."""
    return [line.removesuffix(NOTE).rstrip() for line in table.splitlines()[1:]]


def test_names_break_after_an_underscore():
    table = as_table([{"entry": "unit-revolute_6x7_k1_manipulability", "note": NOTE}])
    assert names(table) == ["unit-revolute_6x7_k1_", "manipulability"]


@given(st.text("ab_ -", max_size=60))
def test_nothing_of_a_broken_text_is_lost(name):
    table = as_table([{"entry": f"x{name}", "note": NOTE}])
    assert "".join("".join(names(table)).split()) == "".join(f"x{name}".split())
    assert all(len(line) <= WIDTH for line in table.splitlines())
