"""One thread for small matrices, and the best known 7R."""

import json
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from tests.formulations.bounds.moments.made_rotations import worst_case

ATTAINED = Path(__file__).parents[4] / "results" / "comparison" / "jacobians.json"


@pytest.fixture(autouse=True, scope="package")
def one_blas_thread():
    """Many small matrices: with busy cores a second thread costs ten times what it saves."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@pytest.fixture(scope="session")
def attained():
    """Return the rotations of the best known 7R and its squared worst case, by SVD."""
    records = json.loads(ATTAINED.read_text(encoding="utf-8"))
    found = []
    for record in records:
        if (record["formulation"], record["model"]) == ("max-min", "unit-revolute"):
            v, omega = np.split(np.array(record["jacobian"]).T, 2, axis=1)
            found.append(np.stack([v, omega, np.cross(v, omega)], axis=-1))
    best = max(found, key=worst_case)
    return best[None], worst_case(best)
