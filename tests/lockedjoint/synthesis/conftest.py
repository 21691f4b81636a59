"""Jacobians of every kind that can be realised, and robots made of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from lockedjoint.formulations.reproduction import reference
from lockedjoint.synthesis.from_jacobian import realise
from tests.made_robots import random_revolute

RESULTS = Path(__file__).parents[3] / "results" / "comparison" / "jacobians.json"


def mixed():
    """Revolute and prismatic joints, axes through the end effector, parallel and crossing."""
    matrix = random_revolute(3, 9, np.linspace(0.5, 2.0, 9))
    matrix[3:, 1], matrix[:3, 1] = 0.0, [0.6, 0.0, 0.8]
    matrix[3:, 4], matrix[:3, 4] = 0.0, [0.0, 1.0, 0.0]
    matrix[:3, 2] = 0.0  # through the end effector
    matrix[3:, 6] = matrix[3:, 5]  # parallel to the one before
    matrix[:3, 6] = np.cross(matrix[3:, 6], [0.3, 1.0, -0.2])
    matrix[:, 8] = matrix[:, 7]  # one and the same axis
    return matrix


def optima():
    """Every Jacobian of the committed comparison."""
    found = json.loads(RESULTS.read_text(encoding="utf-8"))
    names = [
        " ".join(filter(None, (f["formulation"], f["variant"], f["model"]))) for f in found
    ]
    return {name: np.array(f["jacobian"]) for name, f in zip(names, found, strict=True)}


def manipulators():
    """Manipulators of every task, by name."""
    turns = np.eye(3)[:, [0, 1, 2, 0]].copy()
    turns[:, 3] = [0.6, 0.0, 0.8]
    pose = np.array([[0.2, -1.0, 0.6, 1.4], [1.0, 0.3, 0.8, 0.0], [1.0, -1.0, 0.0, 1.0]])
    found = {name: realise(matrix) for name, matrix in optima().items()}
    return found | {
        "planar 3R": realise(reference.PLANAR_3R),
        "planar 4R": realise(reference.planar_4r(0.3)[:2]),
        "planar RPRR": realise([[0.5, 0.8, 1, -1], [0, 0.6, 1, 0.3]], kinds="RPRR"),
        "planar pose": realise(pose, space="planar-pose"),
        "positional 4R": realise(reference.POSITIONAL_4R[:3]),
        "rotational": realise(turns, space="rotational"),
        "mixed": realise(mixed()),
        "elsewhere": realise(random_revolute(1), end_effector=(1.0, -2.0, 0.5), metres=0.4),
    }


@pytest.fixture(scope="session")
def optimum():
    """The best 7R of unit lever arms."""
    return optima()["max-min unit-revolute"]


def pytest_generate_tests(metafunc):
    if "arm" in metafunc.fixturenames:
        known = manipulators()
        metafunc.parametrize("arm", known.values(), ids=known.keys())
