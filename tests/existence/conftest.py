"""What several tests of the proof need: the division for seven joints and its certificate."""

from __future__ import annotations

from pathlib import Path

import pytest

from formulations.existence.certificate import Certificate
from formulations.existence.derive import SEVEN_REVOLUTE, derive
from formulations.existence.rewriting import Rewriting, rewriting

COMMITTED = Path(__file__).parents[2] / "results" / "existence" / "certificate.json"


@pytest.fixture(scope="session")
def committed() -> Path:
    return COMMITTED


@pytest.fixture(scope="session")
def derived() -> Certificate:
    return derive()


@pytest.fixture(scope="session")
def seven() -> Rewriting:
    return rewriting(SEVEN_REVOLUTE, 3)
