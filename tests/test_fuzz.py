"""Random input is refused in a sentence, or done: the short form of results/fuzz."""

import pytest

from results.fuzz import trials
from results.fuzz.fuzz import COUNTS, complain, row_of

SHORT = {
    "calls": 3_000,
    "command lines": 60,
    "stores": 80,
    "certificates": 100,
    "two-point certificates": 10,
    "relaxation certificates": 30,
    "lever certificates": 10,
}


@pytest.mark.parametrize("kind", COUNTS)
def test_nothing_ends_raw_or_wrong(kind):
    """From another seed than that of the table."""
    row = row_of(kind, 1, SHORT[kind])
    assert row.done + row.refused + row.raw + row.wrong == row.trials
    assert row.refused > 0
    assert (row.raw, row.wrong) == (0, 0)


def test_what_is_raw_is_counted(monkeypatch):
    """An error of Python in a function that is called, and a check that accepts all."""

    def fails(*_, **__):
        raise KeyError

    monkeypatch.setattr(trials.lj, "measure", fails)
    monkeypatch.setattr(trials, "check", lambda _: 1)
    calls, certificates = row_of("calls", 0, 200), row_of("certificates", 0, 5)
    assert calls.raw > 0
    assert certificates.wrong == certificates.trials
    assert complain([calls, certificates])
