"""The reproduction: verdicts as they come out, and that every one of them can fail."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from decimal import Decimal
from itertools import islice
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from formulations import appendix as closed
from formulations import measures
from formulations.io.table import read_rows
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.reproduction import (
    ReproductionRow,
    Verdict,
    canonical,
    definition,
    eight_joints,
    iterate,
    planar,
    reference,
    rotational,
    searches,
    seven_joints,
    study,
)
from formulations.reproduction.eight_joints import ARM
from formulations.reproduction.printed import (
    aligned,
    defect_slack,
    nearest_unit_revolute,
    product_slack,
    rounded,
    singular_value_slack,
)
from formulations.reproduction.row import (
    equal,
    farthest,
    improvement,
    misprint,
    printed_digits,
    shown,
    shown_range,
)
from formulations.reproduction.solution_family import solve_near
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.multistart import MultistartResult


@pytest.fixture(scope="module")
def rows() -> tuple[ReproductionRow, ...]:
    return tuple(iterate())


def verdicts(rows: Iterable[ReproductionRow]) -> dict[str, list[Verdict]]:
    found: dict[str, list[Verdict]] = {}
    for row in rows:
        found.setdefault(row.equation, []).append(row.verdict)
    return found


def nudged(matrix: FloatArray, amount: float, at: tuple[int, ...] = (1, 2)) -> FloatArray:
    changed = matrix.copy()
    changed[at] += amount
    return changed


# As it comes out --------------------------------------------------------------------------


def test_nothing_is_unexplained(rows: tuple[ReproductionRow, ...]) -> None:
    assert [row for row in rows if row.verdict is Verdict.MISMATCH] == []


def test_the_committed_table_is_this(rows: tuple[ReproductionRow, ...]) -> None:
    path = Path(__file__).parents[2] / "results/reproduction/reproduction.csv"
    committed = read_rows(path, ReproductionRow)
    first_search = [row.equation for row in committed].index("before (44)")
    for new, old in zip(rows, committed, strict=True):
        assert (new.equation, new.verdict) == (old.equation, old.verdict)
    for new, old in zip(rows[:first_search], committed[:first_search], strict=True):
        assert new.quantity == old.quantity
        assert numbers(new.ours) == pytest.approx(numbers(old.ours), abs=1e-6)


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text)]


@pytest.mark.parametrize(
    ("verdict", "equations"),
    [
        (Verdict.MISPRINT, ["(21)", "(22)", "(39)"]),
        (Verdict.ROUNDED, ["(44)", "(45)", "(45)", "(46)", "(46)"]),
        (Verdict.IMPROVED, ["after (46)", "Sec. 5"]),
    ],
)
def test_what_does_not_simply_agree(
    rows: tuple[ReproductionRow, ...], verdict: Verdict, equations: list[str]
) -> None:
    assert [row.equation for row in rows if row.verdict is verdict] == equations


def test_every_equation_with_a_claim_has_a_row(rows: tuple[ReproductionRow, ...]) -> None:
    text = " ".join(row.equation for row in rows)
    for number in (*range(9, 11), *range(12, 50)):
        assert f"({number})" in text


def test_key_numbers(rows: tuple[ReproductionRow, ...]) -> None:
    ours = [row.ours for row in rows]
    for number in ("0.05682655", "0.5714830", "0.5198558", "0.3826834", "0.06486585"):
        assert number in ours


def test_another_seed_and_fewer_starts_give_the_same_verdicts(
    rows: tuple[ReproductionRow, ...],
) -> None:
    others = list(iterate(seed=11, starts=8))
    assert Counter(row.verdict for row in others) == Counter(row.verdict for row in rows)


def test_rows_come_one_by_one_and_are_the_same_again(
    rows: tuple[ReproductionRow, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seven_joints, "minima", None)  # not needed before its own rows
    before = next(i for i, row in enumerate(rows) if row.equation == "before (44)")
    assert tuple(islice(iterate(), before)) == rows[:before]


def test_a_mismatch_is_a_complaint() -> None:
    agreed = ReproductionRow("(6)", "bound", "1", "1", Verdict.AGREES)
    assert study().complain([agreed]) == ""
    assert "unexplained" in study().complain(
        [agreed, replace(agreed, verdict=Verdict.MISMATCH)]
    )


@pytest.mark.parametrize("arguments", [{"starts": 0}, {"seed": -1}, {"seed": 1.5}])
def test_bad_numbers_are_refused_before_any_row(arguments: dict[str, int]) -> None:
    with pytest.raises(InputError):
        iterate(**arguments)


def test_interrupted_search_gives_no_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> MultistartResult:
        return MultistartResult((), complete=False)

    monkeypatch.setattr(searches, "multistart", interrupted)
    with pytest.raises(KeyboardInterrupt):
        canonical.rotation_row()


# That it can fail -------------------------------------------------------------------------


def test_changed_planar_3r() -> None:
    found = verdicts(
        planar.three_joint_rows(starts=2, jacobian=nudged(reference.PLANAR_3R, 1e-6))
    )
    for equation in ("(12)", "Fig. 1", "(13)", "after (13)", "(14)"):
        assert found[equation] == [Verdict.MISMATCH]
    assert found["Fig. 2"] == [Verdict.AGREES] * 2


def test_changed_null_space() -> None:
    changed = nudged(reference.PLANAR_3R_NULL_SPACE, 1e-6, (0,))
    assert verdicts(planar.three_joint_rows(starts=2, null_space=changed))["(13)"] == [
        Verdict.MISMATCH
    ]


def test_direction_that_is_not_a_column() -> None:
    stretched = np.diag([1.0, 2.0]) @ reference.PLANAR_3R
    assert verdicts(planar.three_joint_rows(starts=2, jacobian=stretched))["(15)"] == [
        Verdict.MISMATCH
    ]


def test_changed_extremes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "PLANAR_3R_SIGMA", 0.58)
    monkeypatch.setattr(planar, "IDLE_JOINT", np.eye(2, 3) + 0.1)
    found = verdicts(planar.three_joint_rows(starts=2))
    assert found["Fig. 2"] == [Verdict.MISMATCH] * 2
    assert found["(14)"] == [Verdict.MISMATCH]


def test_changed_planar_family() -> None:
    def family(alpha: float) -> FloatArray:
        return nudged(reference.planar_4r(alpha), 1e-6)

    found = verdicts(planar.four_joint_rows(starts=2, family=family))
    assert found["(16)"][0] is Verdict.MISMATCH
    assert found["(17)"] == [Verdict.MISMATCH]


def test_other_optimal_angles() -> None:
    def shifted(alpha: float) -> FloatArray:
        return reference.planar_4r(alpha + 0.1)

    found = verdicts(planar.four_joint_rows(starts=2, family=shifted))
    assert found["after (17)"] == [Verdict.MISMATCH] * 4


def test_family_of_one_member() -> None:
    def constant(_: float) -> FloatArray:
        return reference.planar_4r(np.pi / 4)

    found = verdicts(planar.four_joint_rows(starts=2, family=constant))
    assert found["(16)"] == [Verdict.AGREES, Verdict.MISMATCH]
    assert found["(17)"] == [Verdict.AGREES]
    assert found["after (17)"][0] is Verdict.MISMATCH


def test_changed_positional_4r() -> None:
    found = canonical.positional_rows(nudged(reference.POSITIONAL_4R, 1e-6))
    assert {row.verdict for row in found} == {Verdict.MISMATCH}


def test_changed_canonical_jacobian() -> None:
    changed = nudged(reference.CANONICAL_6X7, 1e-6)
    found = [row.verdict for row in canonical.canonical_rows(jacobian=changed)]
    assert found[:4] == [Verdict.MISMATCH] * 4


def test_canonical_jacobian_with_revolute_columns() -> None:
    jacobian = np.vstack([np.eye(3, 7), np.eye(3, 7, k=1)]) + 0.0
    found = list(canonical.canonical_rows(jacobian=jacobian))
    assert found[-2].verdict is Verdict.MISMATCH


def test_bound_that_is_too_low(monkeypatch: pytest.MonkeyPatch) -> None:
    true_bound = measures.sigma_bound
    monkeypatch.setattr(measures, "sigma_bound", lambda m, n, t: 0.9 * true_bound(m, n, t))
    assert verdicts(definition.rows())["(6)"] == [Verdict.MISMATCH] * 3


def test_contributions_that_are_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "range_contributions", lambda j: np.sum(j**2, axis=0))
    assert verdicts(definition.rows())["(7)–(9)"] == [Verdict.MISMATCH]


def test_other_counts_of_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "INDEPENDENT_NORM_EQUATIONS", 5)
    found = verdicts(rotational.rows())
    assert found["(23)–(28)"][-1] is Verdict.MISMATCH
    assert found["(23)–(43)"] == [Verdict.MISMATCH]


def test_only_the_third_place_takes_the_zero() -> None:
    errors = rotational.second_vector_errors(np.random.default_rng(0))
    assert errors[2] < 1e-12
    assert min(errors[:2]) > 0.1


@pytest.mark.parametrize("k", [3, 9, 18, 21])
def test_changed_closed_form(k: int) -> None:
    def wrong(variables: ca.SX) -> ca.SX:
        forms = closed.closed_forms(variables, as_printed=True)
        forms[k - 1] = forms[k - 1] * 1.001
        return forms

    found = [row.verdict for row in rotational.appendix_rows(printed=wrong, corrected=wrong)]
    expected = {k - 1, closed.MISPRINTED - 1}
    assert {i for i, v in enumerate(found) if v is Verdict.MISMATCH} == expected


def test_correction_of_f17_that_is_wrong() -> None:
    def wrong(variables: ca.SX) -> ca.SX:
        return closed.closed_forms(variables, as_printed=True)

    assert verdicts(rotational.appendix_rows(corrected=wrong))["(39)"] == [Verdict.MISMATCH]


def test_print_of_f17_that_is_right() -> None:
    assert verdicts(rotational.appendix_rows(printed=closed.closed_forms))["(39)"] == [
        Verdict.AGREES
    ]


def test_orthogonal_u_that_does_turn_into_revolute_joints_would_be_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    solution = eight_joints.solutions(8, seed=0, starts=1)[0].outputs["jacobian"]
    rng = np.random.default_rng(0)
    turn = canonical.random_rotation(rng).reshape(6, 6)
    hidden = turn @ solution / np.sqrt(8 / 3)
    assert canonical.violation(np.sqrt(8 / 3) * hidden) > 1e-2
    start = turn.ravel() + 0.01 * rng.standard_normal(36)  # CasADi stacks columns: this is Uᵀ
    monkeypatch.setattr(canonical, "random_rotation", lambda _: start)
    row = canonical.rotation_row(starts=1, jacobian=hidden)
    assert row.verdict is Verdict.IMPROVED


def test_changed_nearly_optimal_7r() -> None:
    found = verdicts(
        seven_joints.rows(starts=3, printed=nudged(reference.NEARLY_OPTIMAL_7R, 5e-3))
    )
    assert found["(44)"] == [Verdict.MISMATCH] * 4


def test_changed_numbers_of_the_7r() -> None:
    values = (Decimal("1.5828"), *reference.SINGULAR_VALUES_7R[1:])
    found = verdicts(
        seven_joints.rows(starts=3, singular_values=values, minimum=Decimal("0.056826"))
    )
    assert found["before (44)"][0] is Verdict.MISMATCH
    assert found["(45)"][0] is Verdict.MISMATCH


def test_another_local_minimum_would_show(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    true_minima = seven_joints.minima(0, 3)
    stray = seven_joints.ARM.jacobian(seven_joints.ARM.sample(rng))
    monkeypatch.setattr(seven_joints, "minima", lambda *_: [*true_minima, stray])
    found = list(seven_joints.rows(starts=4))
    assert found[1].verdict is Verdict.MISMATCH
    assert [row.verdict for row in found if row.quantity.startswith("the same for all")] == [
        Verdict.MISMATCH
    ]


@pytest.mark.parametrize("printed", ["0.5197", "0.5195"])
def test_changed_worst_case(printed: str) -> None:
    found = seven_joints.worst_case_rows(starts=1, worst_case=Decimal(printed))
    assert next(found).verdict is Verdict.MISMATCH


def test_changed_worst_joint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "WORST_JOINT_7R", 3)
    monkeypatch.setattr(reference, "POORER_PERCENT_7R", Decimal(9))
    found = list(seven_joints.worst_case_rows(starts=1))
    assert found[1].verdict is Verdict.MISMATCH
    assert found[3].verdict is Verdict.MISMATCH


def test_optimal_7r_would_be_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = seven_joints.worst_case_rows(starts=3)
    for _ in range(5):
        next(rows)
    monkeypatch.setattr(seven_joints, "ARM", Arm.of(UnitRevolute(), 8))
    assert next(rows).verdict is Verdict.IMPROVED


def test_changed_optimal_8r() -> None:
    found = verdicts(eight_joints.rows(starts=2, printed=nudged(reference.OPTIMAL_8R, 0.05)))
    assert found["(47)"] == [Verdict.MISMATCH] * 3
    assert found["(48)"] == found["(49)"] == [Verdict.AGREES]


def test_a_print_with_no_solution_nearby(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(*_: object) -> FloatArray:
        raise InputError("angles", "far from any solution", "angles near an isotropic Jacobian")

    monkeypatch.setattr(eight_joints, "solve_near", lost)
    assert verdicts(eight_joints.rows(starts=1)) == {"(47)": [Verdict.MISMATCH]}


def test_changed_optimum_of_8r(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "SIGMA_8R", reference.SIGMA_8R + 2e-9)
    monkeypatch.setattr(reference, "WORST_CASE_8R", reference.WORST_CASE_8R + 2e-9)
    found = verdicts(eight_joints.rows(starts=2))
    assert found["(48)"] == found["(49)"] == [Verdict.MISMATCH]


def test_8r_that_do_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measures, "is_optimally_failure_tolerant", lambda *_: False)
    found = list(eight_joints.rows(starts=2))
    assert {row.verdict for row in found if "random starts" in row.quantity} == {
        Verdict.MISMATCH
    }


def test_curve_that_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    start = solve_near(ARM, ARM.variables(nearest_unit_revolute(reference.OPTIMAL_8R)))
    monkeypatch.setattr(eight_joints, "trace_family", lambda *given: [given[1]] * 2)
    monkeypatch.setattr(eight_joints, "fills_tangent_space", lambda *_: False)
    found = islice(eight_joints.family_rows(start, []), 2)
    assert [row.verdict for row in found] == [Verdict.MISMATCH] * 2


# The verdicts themselves ------------------------------------------------------------------


def test_equal_is_false_for_nan() -> None:
    assert equal(1.0, [1.0, float("nan")], 1e-3) is Verdict.MISMATCH


@pytest.mark.parametrize(
    ("exact", "from_print", "verdict"),
    [
        (0.51964, None, Verdict.AGREES),
        (0.51986, 0.51961, Verdict.ROUNDED),
        (0.51986, 0.51970, Verdict.MISMATCH),
        (0.51986, None, Verdict.MISMATCH),
        (0.519547, None, Verdict.ROUNDED),  # 0.51955, then 0.5196
        (float("nan"), float("nan"), Verdict.MISMATCH),
    ],
)
def test_printed_digits(exact: float, from_print: float | None, verdict: Verdict) -> None:
    assert printed_digits(Decimal("0.5196"), exact, from_print) is verdict


@pytest.mark.parametrize(
    ("errors", "verdict"),
    [
        ((0.0, 0.0), Verdict.AGREES),
        ((1.0, 0.0), Verdict.MISPRINT),
        ((1.0, 1.0), Verdict.MISMATCH),
        ((float("nan"), float("nan")), Verdict.MISMATCH),
    ],
)
def test_misprint(errors: tuple[float, float], verdict: Verdict) -> None:
    assert misprint(*errors) is verdict


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [(0.6, Verdict.IMPROVED), (0.5, Verdict.AGREES), (0.4, Verdict.MISMATCH)],
)
def test_improvement(ours: float, verdict: Verdict) -> None:
    assert improvement(0.5, ours, 1e-6) is verdict


@pytest.mark.parametrize("seed", range(20))
def test_slacks_bound_what_rounding_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    exact = rng.standard_normal((6, 7))
    printed = np.round(exact, 2)
    moved = np.abs(measures.singular_values(exact) - measures.singular_values(printed))
    assert moved.max() <= singular_value_slack(printed, 0.005)
    assert np.abs(exact @ exact.T - printed @ printed.T).max() <= product_slack(printed, 0.005)
    defects = [measures.isotropy_defect(matrix) for matrix in (exact, printed)]
    assert abs(defects[0] - defects[1]) <= defect_slack(printed, defects[1], 0.005)


def test_halves_round_up_as_in_print() -> None:
    assert rounded(0.125, Decimal("0.01")) == Decimal("0.13")


def test_seven_significant_digits() -> None:
    assert shown([0.5, 1 / 3]) == "0.5000000, 0.3333333"
    assert shown_range([0.5, 1 / 3, 0.4]) == "0.3333333 to 0.5000000"
    assert farthest(0.5)([0.5, 1 / 3, 0.6]) == "0.3333333"


def test_alignment_undoes_a_turn_and_a_phase() -> None:
    arm = Arm.of(UnitRevolute(), 7)
    target = arm.jacobian(arm.sample(np.random.default_rng(2)))
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    v, w = turn @ target[:3], turn @ target[3:]
    moved = np.vstack([c * v - s * w, s * v + c * w])
    np.testing.assert_allclose(aligned(moved, target), target, atol=1e-9)
    np.testing.assert_allclose(nearest_unit_revolute(1.01 * target), target, atol=1e-12)
