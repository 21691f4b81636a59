"""The certificate of lever arms: what is read, what is refused, and what is proved from it."""

import json
from concurrent.futures import Executor, Future
from copy import deepcopy
from dataclasses import replace
from fractions import Fraction
from math import inf, nan, nextafter, sqrt
from pathlib import Path

import numpy as np
import pytest

from lockedjoint.formulations.bounds import lever_certificate
from lockedjoint.formulations.bounds.lever_cells.regions import End, Tally
from lockedjoint.formulations.bounds.lever_certificate import (
    FIELDS,
    MOST_CENTRES,
    LeverCertificate,
    VerifiedLevers,
    verify_levers,
)
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.reading import Part
from results.bounds.lever_centres import random_frame

COMMITTED = Path(__file__).parents[3] / "results/bounds/certificates/isotropic_levers.json"
#: The centre on whose sphere the last centre fills a hole.
HOLE = 15
LIMIT = Fraction(9, 100)


@pytest.fixture(scope="module")
def frames():
    rng = np.random.default_rng(0)
    return np.array([random_frame(rng)[0] for _ in range(3)])


@pytest.fixture(scope="module")
def certificate(frames):
    return LeverCertificate.of_frames(frames, 0.25, LIMIT)


@pytest.fixture
def document(certificate):
    return json.loads(json.dumps(certificate.to_dict()))


def read(document):
    return LeverCertificate.read(Part(json.loads(json.dumps(document))))


def refusal(document):
    """The sentence with which a document is refused."""
    with pytest.raises(CertificateError) as caught:
        read(document)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.endswith(".")
    assert len(sentence) < 300
    return sentence


def test_certificate_is_read_as_it_was_written(certificate, document):
    assert tuple(document) == FIELDS
    again = read(document)
    assert (again.frames == certificate.frames).all()
    assert (again.limit, again.radius) == (LIMIT, 0.25)
    assert again.bound == certificate.bound
    assert again.to_dict() == certificate.to_dict() == document


def test_bound_is_what_follows(certificate, document):
    assert certificate.bound == pytest.approx(sqrt(1 / 3 - 0.09), abs=1e-15)
    assert Fraction(certificate.bound) ** 2 >= Fraction(1, 3) - LIMIT
    less = nextafter(certificate.bound, 0.0)
    assert Fraction(less) ** 2 < Fraction(1, 3) - LIMIT
    assert read(document | {"bound": 0.5}).bound == 0.5
    sentence = refusal(document | {"bound": less})
    assert sentence == f"bound: {less} does not follow; it is less than √(1/3 − 9/100)."


def test_bound_is_compared_exactly(frames):
    """Bounds just below what follows are refused also where doubles do not show it."""
    unseen = 0
    for k in range(0, 110, 3):
        made = LeverCertificate.of_frames(frames, 0.25, Fraction(k, 1000))
        less = nextafter(made.bound, 0.0)
        unseen += less**2 >= float(Fraction(1, 3) - made.limit)
        with pytest.raises(CertificateError, match="does not follow"):
            replace(made, bound=less)
    assert unseen > 0


def test_no_radius_is_nan(certificate):
    with pytest.raises(CertificateError, match="radius: nan is not from"):
        replace(certificate, radius=nan)


@pytest.mark.parametrize("bound", [nan, inf, -inf, -0.5, 0.0])
def test_bounds_that_do_not_follow(certificate, bound):
    with pytest.raises(CertificateError, match=r"bound: .* does not follow"):
        replace(certificate, bound=bound)


@pytest.mark.parametrize("name", FIELDS)
def test_missing_fields(document, name):
    del document[name]
    assert refusal(document) == f"'{name}' is missing."


def test_unknown_field(document):
    assert refusal(document | {"note": "mine"}) == 'the key "note" is unknown.'


ILL_FORMED = [
    ("format", "lockedjoint-levers-2", "format: it is not 'lockedjoint-levers-1'."),
    ("format", None, "format: it is not 'lockedjoint-levers-1'."),
    ("quantity", "isotropy", "quantity: it is not 'isotropic lever arms'."),
    ("quantity", 7, "quantity: it is not 'isotropic lever arms'."),
    ("joints", 8, "joints: 8 is not 7."),
    ("joints", 6, "joints: 6 is not 7."),
    ("joints", 7.0, "joints: 7.0 is not a whole number of at most 40 digits."),
    ("joints", "7", 'joints: "7" is not a whole number of at most 40 digits.'),
    ("limit", 0.09, "limit: 0.09 is not a rational number in a string"),
    ("limit", "0.09", 'limit: "0.09" is not a rational number in a string'),
    ("limit", "1/0", 'limit: "1/0" is not a rational number in a string'),
    ("limit", "-1/100", "limit: -1/100 is not from 0 to 11/100."),
    ("limit", "111/1000", "limit: 111/1000 is not from 0 to 11/100."),
    ("bound", "0.5", 'bound: "0.5" is not a decimal number up to 1.'),
    ("bound", 1, "bound: 1 is not a decimal number up to 1."),
    ("bound", 1.5, "bound: 1.5 is not a decimal number up to 1."),
    ("bound", nan, "bound: NaN is not a decimal number up to 1."),
    ("bound", inf, "bound: Infinity is not a decimal number up to 1."),
    ("bound", -0.5, "bound: -0.5 does not follow"),
    ("radius", None, "radius: null is not a decimal number up to 1."),
    ("radius", nan, "radius: NaN is not a decimal number up to 1."),
    ("radius", 0.0999, "radius: 0.0999 is not from 0.1 to 0.35."),
    ("radius", 0.3501, "radius: 0.3501 is not from 0.1 to 0.35."),
    ("radius", -0.25, "radius: -0.25 is not from 0.1 to 0.35."),
    ("frames", {}, "frames: an object is not a list."),
    ("frames", [], "frames: a list of 0 items, not of 1 to 500."),
    ("frames", [[]] * (MOST_CENTRES + 1), "frames: a list of 501 items, not of 1 to 500."),
]


@pytest.mark.parametrize(("name", "value", "sentence"), ILL_FORMED)
def test_ill_formed_fields(document, name, value, sentence):
    assert refusal(document | {name: value}).startswith(sentence)


def changed_frames(document, place, value):
    """A document with a change at a place in its frames."""
    changed = deepcopy(document)
    part = changed["frames"]
    for k in place[:-1]:
        part = part[k]
    part[place[-1]] = value
    return changed


@pytest.mark.parametrize(
    ("place", "value", "sentence"),
    [
        ((1,), 0.5, "frames: [1]: 0.5 is not a list."),
        ((1,), [[0.0] * 7] * 2, "frames: [1]: a list of 2 items, not of 3."),
        ((1, 2), [0.0] * 6, "frames: [1]: [2]: a list of 6 items, not of 7."),
        ((1, 2), "0", 'frames: [1]: [2]: "0" is not a list.'),
        ((1, 2, 3), 0, "frames: [1]: [2]: [3]: 0 is not a decimal number up to 1."),
        ((1, 2, 3), nan, "frames: [1]: [2]: [3]: NaN is not a decimal number up to 1."),
        ((1, 2, 3), None, "frames: [1]: [2]: [3]: null is not a decimal number up to 1."),
        ((1, 2, 3), 0.9, "frames: [1] is no unit tight frame, off by "),
        ((1, 2), [0.0] * 7, "frames: [1] is no unit tight frame, off by 1.0e+00."),
    ],
)
def test_ill_formed_frames(document, place, value, sentence):
    assert refusal(changed_frames(document, place, value)).startswith(sentence)


def test_frames_that_are_not_tight(certificate, frames):
    # an orthonormal frame with columns of other lengths, and one that is not orthonormal
    other = np.linalg.svd(np.random.default_rng(1).normal(size=(3, 7)), full_matrices=False)[2]
    stretched = np.diag([1.0, 1.0, 1 + 1e-8]) @ frames[0]
    for bad in (other, stretched, np.full((3, 7), nan)):
        with pytest.raises(CertificateError, match=r"frames: \[3\] is no unit tight frame"):
            replace(certificate, frames=np.concatenate([frames, bad[None]]))
    near = frames * (1 + 1e-11)
    assert (replace(certificate, frames=near).frames == near).all()


def test_frames_of_other_shapes(certificate, frames):
    for bad in (frames[:0], frames[:, :2], frames[:, :, :6], np.tile(frames, (200, 1, 1))):
        with pytest.raises(CertificateError, match=r"the shape \(.*\) is not \(C, 3, 7\)"):
            replace(certificate, frames=bad)


def test_limits_and_radii_at_their_ends(frames):
    for limit in (Fraction(0), Fraction(11, 100)):
        for radius in (0.1, 0.35):
            assert LeverCertificate.of_frames(frames, radius, limit).limit == limit


def test_other_values_are_no_certificate(document):
    for value in ([document], None, 7):
        with pytest.raises(CertificateError, match="is not an object with format, quantity"):
            read(value)


def test_balls_that_do_not_hold_all_frames(certificate):
    """Three balls of the smallest radius: each sphere is a hole."""
    steps = []
    small = replace(certificate, radius=0.1)
    with pytest.raises(CertificateError, match=r"\d boxes on the sphere of centre 0 are not"):
        verify_levers(small, progress=steps.append)
    # nothing was proved after it
    assert steps == ["1 of 3 trees (sphere)"]


def test_committed_centres_are_all_needed_at_one_hole():
    """The last centre fills a hole of another's sphere: without it nothing is proved."""
    whole = LeverCertificate.read(Part(json.loads(COMMITTED.read_text("utf-8"))))
    frames = np.concatenate([whole.frames[HOLE][None], np.delete(whole.frames, HOLE, 0)[:-1]])
    with pytest.raises(CertificateError, match=r"\d boxes on the sphere of centre 0 are not"):
        verify_levers(replace(whole, frames=frames))


class StandIn(Executor):
    """An executor that answers calls with trees made before, the last call first."""

    def __init__(self, trees):
        self.trees, self.calls = trees, []

    def submit(self, _work, _certificate, k, task):
        self.calls.append((k, task))
        future = Future()
        future.set_result((k, self.trees[task][k]))
        return future


def tree(scale, left=0):
    """A tree of which all numbers differ."""
    made = Tally(nodes=11 * scale, programs=7 * scale, left=left)
    for k, end in enumerate(End, 1):
        made.ends[end] = k * scale
    return made


def test_trees_of_all_centres_are_added(certificate):
    trees = {"sphere": [tree(k) for k in (1, 10, 100)], "arms": [tree(k) for k in (2, 20, 200)]}
    executor, steps = StandIn(trees), []
    found = verify_levers(certificate, executor=executor, progress=steps.append)
    assert sorted(executor.calls) == [
        (k, task) for k in range(3) for task in ("arms", "sphere")
    ]
    assert found == VerifiedLevers(
        claimed=certificate.bound,
        limit="9/100",
        centres=3,
        sphere_boxes=11 * 111,
        arm_boxes=11 * 222,
        certificates=(7 + 8) * 222,
        programs=7 * 222,
    )
    assert steps == [f"{k} of 3 trees ({t})" for t in ("sphere", "arms") for k in (1, 2, 3)]


@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize(
    ("task", "where"), [("sphere", "on the sphere"), ("arms", "in the ball")]
)
def test_one_box_that_is_left_refutes(certificate, task, where, k):
    trees = {one: [tree(1) for _ in range(3)] for one in ("sphere", "arms")}
    trees[task][k] = tree(1, left=5)
    with pytest.raises(CertificateError) as caught:
        verify_levers(certificate, executor=StandIn(trees))
    assert str(caught.value) == f"frames: 5 boxes {where} of centre {k} are not excluded."


def test_trees_are_of_the_stated_balls_and_a_limit_rounded_up(certificate, monkeypatch):
    """Instead of the trees themselves, which take hours, what they are asked is recorded."""
    asked = {"sphere": [], "arms": []}

    def sphere(region):
        asked["sphere"].append(region)
        return Tally()

    def arms_excluded(region, limit):
        asked["arms"].append(region)
        assert LIMIT <= limit == pytest.approx(0.09, abs=1e-15)
        return Tally()

    monkeypatch.setattr(lever_certificate, "sphere", sphere)
    monkeypatch.setattr(lever_certificate, "arms_excluded", arms_excluded)
    # 0.09 as a double is below 9/100
    assert Fraction(0.09) < LIMIT
    for k in range(3):
        lever_certificate._tree(certificate, k, "sphere")
    assert (len(asked["sphere"]), len(asked["arms"])) == (3, 0)
    asked["sphere"].clear()
    verify_levers(certificate)
    for regions in asked.values():
        assert [region.level for region in regions] == [3 - 0.25**2] * 3
        P = np.array([region.P for region in regions])
        expected = np.swapaxes(certificate.frames, 1, 2) @ certificate.frames
        assert pytest.approx(expected, abs=1e-9) == P
