"""What several tests of the proof need: the division for seven joints and its certificate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from formulations.existence.certificate import Certificate
from formulations.existence.derive import SEVEN_REVOLUTE, derive
from formulations.existence.rewriting import Rewriting, rewriting

COMMITTED = Path(__file__).parents[2] / "results" / "existence" / "certificate.json"


@pytest.fixture(scope="session")
def committed() -> Path:
    return COMMITTED


@pytest.fixture(scope="session")
def derived(once: Callable[..., Any]) -> Certificate:
    return once("certificate", derive)


@pytest.fixture(scope="session")
def seven(once: Callable[..., Any]) -> Rewriting:
    return once("rewriting", lambda: rewriting(SEVEN_REVOLUTE, 3))
