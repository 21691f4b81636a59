"""The theorem for other modules: which arms cannot be optimally failure-tolerant.

The package includes a certificate, the one that `derive` finds, byte for byte. It is verified
at the first call, so the answer rests on the verification, not on the file.
"""

from functools import lru_cache
from importlib.resources import as_file, files

from formulations.existence.certificate import Certificate
from formulations.existence.reading import read
from formulations.existence.verify import TheoremReport, verify


def package_certificate() -> Certificate:
    """Read the certificate that the package includes."""
    with as_file(files("formulations.existence") / "certificate.json") as path:
        return read(path)


@lru_cache(maxsize=1)
def verified() -> TheoremReport:
    """Verify the package's certificate and return what was verified.

    Raises
    ------
    CertificateError
        If the identity does not hold.
    """
    return verify(package_certificate())


def excludes(unit_revolute_joints: int) -> bool:
    """Whether it is proved that so many revolute joints have no optimally failure-tolerant
    Jacobian in six task dimensions (docs/nonexistence.md).
    """  # noqa: D205
    return verified().joints == unit_revolute_joints
