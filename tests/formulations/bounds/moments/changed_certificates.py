"""What the tests of certificates share: changes, and sums that are evaluated once."""

import json
from base64 import b64decode, b64encode

import numpy as np

from lockedjoint.formulations.bounds.moments import certificate_reader, verification
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.errors import FileError


def evaluate_once(patch):
    """Let the verifier make one basis for all files, and read and evaluate each sum once.

    The values of rows depend on the sector and the points alone: changed sums share them.
    """
    made = {}
    basis, evaluated = verification.invariant_basis, verification._sector_sum
    read, values = certificate_reader._sector, BlockFamily.plain_values

    def kept(key, make):
        if key not in made:
            made[key] = make()
        return made[key]

    def once(candidates, *arguments):
        key = candidates.astype(float).tobytes(), arguments[:3]
        return kept(key, lambda: basis(candidates, *arguments))

    def sums(certificate, rotations, number, name, squares):
        content = json.dumps([block.to_dict() for block in squares[1]])
        claims = certificate.quantity, certificate.excluded, certificate.spectrum
        key = (*claims, rotations.astype(float).tobytes(), name, squares[0], content)
        arguments = certificate, rotations, number, name, squares
        return number, kept(key, lambda: evaluated(*arguments)[1])

    def sector(part, joints, name):
        key = "read", json.dumps(part.value), joints, name
        return kept(key, lambda: read(part, joints, name))

    def rows(family, wigner, order):
        points = b"".join(one.tobytes() for one in wigner)
        key = "rows", family.sector, family.joints, tuple(order), points
        return kept(key, lambda: values(family, wigner, order))

    patch.setattr(certificate_reader, "_sector", sector)
    patch.setattr(BlockFamily, "plain_values", rows)
    patch.setattr(verification, "invariant_basis", once)
    patch.setattr(verification, "_sector_sum", sums)


def refuses(tmp_path, document):
    """Whether a file is refused in one sentence, or proves less than it states."""
    path = tmp_path / "bound.json"
    path.write_text(json.dumps(document))
    try:
        verify_bound(read_any(path))
    except (CertificateError, FileError) as error:
        said = str(error)
    else:
        return False
    assert len(said) < 400
    assert "\n" not in said
    return True


def blocks_of(document, part):
    return [block for sector in document[part] for block in sector["blocks"]]


def change_factor(block, change):
    """Replace the entries of a block's factor, one after another, by a function of them."""
    matrix = np.frombuffer(b64decode(block["factor"])).copy()
    block["factor"] = b64encode(np.asarray(change(matrix)).tobytes()).decode()
