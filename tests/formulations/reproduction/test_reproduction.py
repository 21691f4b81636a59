"""The reproduction: verdicts as they come out, and that every one of them can fail."""

import re
from dataclasses import replace
from decimal import Decimal
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from lockedjoint.formulations import isotropy_equations, measures
from lockedjoint.formulations.io.table import read_rows
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.formulations.reproduction import (
    ReproductionRow,
    Verdict,
    complaint,
    eight_joints,
    iterate,
    reference,
    section_4,
    sections_2_and_3,
    seven_joints,
)
from lockedjoint.formulations.reproduction.reference import (
    defect_slack,
    product_slack,
    singular_value_slack,
)
from lockedjoint.formulations.reproduction.row import (
    equal,
    improvement,
    misprint,
    printed_digits,
)
from lockedjoint.nlp.errors import InputError

WRONG, AGREES = Verdict.MISMATCH, Verdict.AGREES


@pytest.fixture(scope="module")
def rows():
    return tuple(iterate(starts=12))


def verdicts(rows):
    by_equation: dict[str, list[Verdict]] = {}
    for row in rows:
        by_equation.setdefault(row.equation, []).append(row.verdict)
    return by_equation


def nudged(matrix, amount, at=(1, 2)):
    changed = matrix.copy()
    changed[at] += amount
    return changed


def test_the_committed_table_is_this(rows):
    path = Path(__file__).parents[3] / "results/reproduction/reproduction.csv"
    committed = read_rows(path, ReproductionRow)
    first_search = [row.equation for row in committed].index("before (44)")
    for new, old in zip(rows, committed, strict=True):
        assert (new.equation, new.verdict) == (old.equation, old.verdict)
    for new, old in zip(rows[:first_search], committed[:first_search], strict=True):
        assert new.quantity == old.quantity
        assert numbers(new.ours) == pytest.approx(numbers(old.ours), abs=1e-6)


def numbers(text):
    return [float(number) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text)]


def test_every_equation_has_its_verdict(rows):
    text = " ".join(row.equation for row in rows)
    assert all(f"({number})" in text for number in (9, 10, *range(12, 50)))
    for verdict, equations in (
        (Verdict.MISPRINT, ["(21)", "(22)", "(39)"]),
        (Verdict.ROUNDED, ["(44)", "(45)", "(45)", "(46)", "(46)"]),
        (Verdict.IMPROVED, ["after (46)", "Sec. 5"]),
        (WRONG, []),
    ):
        assert [row.equation for row in rows if row.verdict is verdict] == equations


def test_a_mismatch_is_a_complaint():
    agreed = ReproductionRow("(6)", "bound", "1", "1", Verdict.AGREES)
    assert complaint([agreed]) == ""
    assert "unexplained" in complaint([agreed, replace(agreed, verdict=WRONG)])


CLOSED = isotropy_equations.closed_forms
BOUND, FAMILY, PI = measures.sigma_bound, reference.planar_4r, np.pi
SINGULAR_VALUES = reference.SINGULAR_VALUES_7R
ROWS = {
    "definition": sections_2_and_3.bound_rows,
    "planar 3R": partial(sections_2_and_3.three_joint_rows, starts=2),
    "planar 4R": partial(sections_2_and_3.four_joint_rows, starts=2),
    "positional": sections_2_and_3.positional_rows,
    "canonical": sections_2_and_3.canonical_rows,
    "rotational": section_4.rows,
    "appendix": section_4.appendix_rows,
    "7R": partial(seven_joints.rows, starts=3),
    "(46)": partial(seven_joints.worst_case_rows, starts=1),
    "8R": partial(eight_joints.rows, starts=2),
}
AMOUNTS = dict.fromkeys(("PLANAR_3R", "POSITIONAL_4R", "CANONICAL_6X7"), 1e-6)
AMOUNTS |= {"NEARLY_OPTIMAL_7R": 5e-3, "OPTIMAL_8R": 0.05}
PRINTED = {name: nudged(getattr(reference, name), by) for name, by in AMOUNTS.items()}


def no_solution(*_):
    raise InputError("angles", "far from any solution", "angles near an isotropic Jacobian")


MIXED = np.vstack([np.eye(3, 7), np.eye(3, 7, k=1)])  # some columns are of revolute joints
# Rows, verdicts by equation (Agrees, Mismatch, misPrint, Rounded, Improved), and what is
# changed before they are computed, in `reference` (`...`: one entry of the print), …
CHANGES = [
    ("planar 3R", "(12): M, (13): M, after (13): M, (14): M, Fig. 2: AA", "PLANAR_3R", ...),
    ("planar 3R", "(13): M", "PLANAR_3R_NULL_SPACE", np.array([0.6, 0.5, 0.6])),
    # The direction that suffers most is no column.
    ("planar 3R", "(15): M", "PLANAR_3R", np.diag([1.0, 2.0]) @ reference.PLANAR_3R),
    ("planar 3R", "(14): M, Fig. 2: MA", "PLANAR_3R_SIGMA", 0.58),
    ("planar 4R", "(16): MA, (17): M", "planar_4r", lambda alpha: nudged(FAMILY(alpha), 1e-6)),
    ("planar 4R", "after (17): MMMM", "planar_4r", lambda alpha: FAMILY(alpha + 0.1)),
    # A family of one member.
    ("planar 4R", "(16): AM, (17): A, after (17): MAAM", "planar_4r", lambda _: FAMILY(PI / 4)),
    ("positional", "(18): MM, (19): M", "POSITIONAL_4R", ...),
    ("canonical", "(20): MMMMA", "CANONICAL_6X7", ...),
    ("canonical", "after (20): MA", "CANONICAL_6X7", MIXED),
    ("rotational", "(23)–(28): AM, (23)–(43): M", "INDEPENDENT_NORM_EQUATIONS", 5),
    ("7R", "(44): MMMM", "NEARLY_OPTIMAL_7R", ...),
    ("7R", "before (44): MA", "RESIDUAL_MINIMUM_7R", Decimal("0.056826")),
    ("7R", "(45): MAAARRA", "SINGULAR_VALUES_7R", (Decimal("1.5828"), *SINGULAR_VALUES[1:])),
    ("(46)", "(46): MR", "WORST_CASE_7R", Decimal("0.5197")),
    ("(46)", "(46): MR", "WORST_CASE_7R", Decimal("0.5195")),
    ("(46)", "(46): RM", "WORST_JOINT_7R", 3),
    ("(46)", "after (46): AMI", "POORER_PERCENT_7R", Decimal(9)),
    ("8R", "(47): MMM, (48): A, (49): A", "OPTIMAL_8R", ...),
    ("8R", "(48): M", "SIGMA_8R", reference.SIGMA_8R + 2e-9),
    ("8R", "(49): M", "WORST_CASE_8R", reference.WORST_CASE_8R + 2e-9),
]
# … and elsewhere.
SECTIONS, EIGHT = "reproduction.sections_2_and_3", "reproduction.eight_joints"
CHANGES += [
    ("definition", "(6): MMM", "measures.sigma_bound", lambda *g: 0.9 * BOUND(*g)),
    ("definition", "(7)–(9): M", "measures.range_contributions", lambda j: sum(j**2)),
    ("planar 3R", "Fig. 2: AM", f"{SECTIONS}._IDLE_JOINT", np.eye(2, 3) + 0.1),
    # The correction of f_17 is wrong; its print is right.
    (
        "appendix",
        "(39): M",
        "isotropy_equations.closed_forms",
        lambda q, **_: CLOSED(q, as_printed=True),
    ),
    ("appendix", "(39): A", "isotropy_equations.closed_forms", lambda q, **_: CLOSED(q)),
    ("8R", "(47): M", f"{EIGHT}.solve_near", no_solution),
    ("8R", "Sec. 5: MMM", "measures.is_optimally_failure_tolerant", lambda *_: False),
    # A curve that stands still.
    ("8R", "after (46): AAMA", f"{EIGHT}.trace_family", lambda *given: [given[1]] * 2),
    ("8R", "after (46): AMAA", f"{EIGHT}.fills_tangent_space", lambda *_: False),
]


@pytest.mark.parametrize(("name", "expected", "place", "value"), CHANGES)
def test_a_change_shows(monkeypatch, name, expected, place, value):
    full = place if "." in place else f"reproduction.reference.{place}"
    monkeypatch.setattr(
        f"lockedjoint.formulations.{full}", PRINTED[place] if value is ... else value
    )
    got = verdicts(ROWS[name]())
    letter = {verdict: verdict.name[0] for verdict in Verdict} | {Verdict.MISPRINT: "P"}
    for equation, wanted in (one.split(": ") for one in expected.split(", ")):
        assert "".join(letter[verdict] for verdict in got[equation]) == wanted, equation


@pytest.mark.parametrize("k", [3, 9, 18, 21])
def test_a_changed_closed_form_shows(monkeypatch, k):
    def wrong(variables, **_):
        forms = CLOSED(variables, as_printed=True)
        forms[k - 1] = forms[k - 1] * 1.001
        return forms

    monkeypatch.setattr(isotropy_equations, "closed_forms", wrong)
    got = [row.verdict for row in section_4.appendix_rows()]
    expected = {k - 1, isotropy_equations.MISPRINTED - 1}
    assert {i for i, verdict in enumerate(got) if verdict is WRONG} == expected


def test_orthogonal_u_that_does_turn_into_revolute_joints_would_be_reported(monkeypatch):
    solution = eight_joints.solutions(8, seed=0, starts=1)[0].outputs["jacobian"]
    rng = np.random.default_rng(0)
    factor = sections_2_and_3.random_rotation(rng).reshape(6, 6)
    hidden = factor @ solution / np.sqrt(8 / 3)
    assert sections_2_and_3.violation(np.sqrt(8 / 3) * hidden) > 1e-2
    start = factor.ravel() + 0.01 * rng.standard_normal(36)  # CasADi stacks columns: Uᵀ
    monkeypatch.setattr(sections_2_and_3, "random_rotation", lambda _: start)
    monkeypatch.setattr(reference, "CANONICAL_6X7", hidden)
    assert next(sections_2_and_3.rotation_rows(starts=1)).verdict is Verdict.IMPROVED


def test_another_local_minimum_would_show(monkeypatch):
    stray = seven_joints.ARM.jacobian(seven_joints.ARM.sample(np.random.default_rng(0)))
    true_minima = seven_joints.minima(0, 3)
    monkeypatch.setattr(seven_joints, "minima", lambda *_: [*true_minima, stray])
    got = list(seven_joints.rows(starts=4))
    assert got[1].verdict is WRONG
    assert [row.verdict for row in got if row.quantity.startswith("the same for")] == [WRONG]


def test_optimal_7r_would_be_reported(monkeypatch):
    rows = iter(seven_joints.worst_case_rows(starts=3))
    assert len(list(islice(rows, 5))) == 5
    monkeypatch.setattr(seven_joints, "ARM", Arm.of(UnitRevolute(), 8))
    assert next(rows).verdict is Verdict.IMPROVED


NAN, PRINT = float("nan"), Decimal("0.5196")


@pytest.mark.parametrize(
    ("verdict", "expected"),
    [
        (equal(1.0, [1.0, NAN], 1e-3), WRONG),
        (printed_digits(PRINT, 0.51964), AGREES),
        (printed_digits(PRINT, 0.51986, 0.51961), Verdict.ROUNDED),
        (printed_digits(PRINT, 0.51986, 0.51970), WRONG),
        (printed_digits(PRINT, 0.51986), WRONG),
        (printed_digits(PRINT, 0.519547), Verdict.ROUNDED),  # 0.51955, then 0.5196
        (printed_digits(PRINT, NAN, NAN), WRONG),
        (misprint(0.0, 0.0), AGREES),
        (misprint(1.0, 0.0), Verdict.MISPRINT),
        (misprint(1.0, 1.0), WRONG),
        (misprint(NAN, NAN), WRONG),
        (improvement(0.5, 0.6, 1e-6), Verdict.IMPROVED),
        (improvement(0.5, 0.5, 1e-6), AGREES),
        (improvement(0.5, 0.4, 1e-6), WRONG),
    ],
)
def test_verdicts(verdict, expected):
    assert verdict is expected


@pytest.mark.parametrize("seed", range(20))
def test_slacks_bound_what_rounding_does(seed):
    rng = np.random.default_rng(seed)
    exact = rng.standard_normal((6, 7))
    printed = np.round(exact, 2)
    moved = np.abs(measures.singular_values(exact) - measures.singular_values(printed))
    assert moved.max() <= singular_value_slack(printed, 0.005)
    assert np.abs(exact @ exact.T - printed @ printed.T).max() <= product_slack(printed, 0.005)
    defects = [measures.isotropy_defect(matrix) for matrix in (exact, printed)]
    assert abs(defects[0] - defects[1]) <= defect_slack(printed, defects[1], 0.005)
