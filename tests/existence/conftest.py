"""What several tests of the proof need: the division for seven joints and its certificate."""

from pathlib import Path

import pytest

from formulations.existence.derive import SEVEN_REVOLUTE, derive
from formulations.existence.rewriting import rewriting

COMMITTED = Path(__file__).parents[2] / "results" / "existence" / "certificate.json"


@pytest.fixture(scope="session")
def committed():
    return COMMITTED


@pytest.fixture(scope="session")
def derived(once):
    return once("certificate", derive)


@pytest.fixture(scope="session")
def seven(once):
    return once("rewriting", lambda: rewriting(SEVEN_REVOLUTE, 3))
