"""The arms of the survey, by pinocchio."""

import pinocchio as pin
import pytest

from nlp.errors import MissingLibraryError


@pytest.fixture(scope="session")
def model_of():
    """Arms of the survey by pinocchio; skips those whose package the tests do not need."""

    def model(declared):
        try:
            path = str(declared.path)
        except MissingLibraryError as missing:
            if declared.package != "robosuite":
                raise
            pytest.skip(str(missing))
        mjcf = path.endswith(".xml")
        return pin.buildModelFromMJCF(path) if mjcf else pin.buildModelFromUrdf(path)

    return model
