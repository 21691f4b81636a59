"""The theorem as an answer: which arms cannot be optimally failure-tolerant, and why.

The package carries a certificate (the one that `derive` finds, byte for byte). It is verified
when the question is first asked, so the answer rests on the verification, not on the file.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import as_file, files

from formulations.existence.certificate import Certificate
from formulations.existence.reading import read
from formulations.existence.verify import Report, verify


def package_certificate() -> Certificate:
    """Read the certificate that the package carries."""
    with as_file(files("formulations.existence") / "certificate.json") as path:
        return read(path)


@lru_cache(maxsize=1)
def verified() -> Report:
    """Verify the package's certificate and return what was verified.

    Raises
    ------
    CertificateError
        If it proves nothing.
    """
    return verify(package_certificate())


def excludes(unit_revolute_joints: int) -> bool:
    """Whether it is proved that so many revolute joints have no optimally failure-tolerant
    Jacobian in six task dimensions (docs/nonexistence.md).
    """  # noqa: D205
    return verified().joints == unit_revolute_joints
