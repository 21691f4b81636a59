"""The relaxation: beside closed forms, beside what Jacobians attain, and as a proof."""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lockedjoint as lj
from lockedjoint.formulations import measures, relaxation
from lockedjoint.formulations.bounds import certified
from lockedjoint.formulations.bounds.relaxation_rounding import prove
from lockedjoint.formulations.bounds.relaxed import relaxed
from lockedjoint.formulations.bounds.unequal_failures import weighted_worst_bound
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.gram_conditions import GramCondition, trace_condition
from lockedjoint.formulations.joints.parts import parts_of
from lockedjoint.formulations.measures.unequal_failures import FailureModel, weighted_worst_case
from lockedjoint.nlp.errors import InputError
from results.relaxation.row_traces import isotropic_bound, spatial_bound

#: What a bound may be above its closed form, relative to it.
LOSS = 1e-7
# Arms for which the traces of the linear and of the rotational rows say all.
SPATIAL = [
    "unit-revolute:7",
    "unit-revolute:8",
    "unit-revolute:20",
    "lever-revolute:7",
    "lever-revolute:12",
    "lever-revolute-each:9",
    "lever-revolute(length=0.3):7",
    "lever-revolute(length=3):7",
    "lever-revolute-each(length=300):8",
    "unit-revolute:5,prismatic:2",
    "unit-revolute:4,prismatic:3",
    "unit-revolute:4,prismatic:4",
    "unit-revolute:6,prismatic(speed=0.01):4",
    "lever-revolute-each(length=0.3):6,prismatic(speed=0.5):2",
    "lever-revolute-each(length=0.3):4,lever-revolute-each(length=2):4",
    "unit-revolute:3,lever-revolute(length=0.5):4",
]


@pytest.mark.parametrize("spec", SPATIAL)
def test_it_is_the_closed_form_of_row_traces(spec):
    arm = lj.arm(spec)
    closed = np.sqrt(spatial_bound(arm))
    assert closed * (1 - 1e-12) <= relaxed(arm).value <= closed * (1 + LOSS)


@pytest.mark.parametrize(("m", "n"), [(1, 3), (2, 3), (2, 7), (3, 4), (3, 9), (6, 7), (9, 12)])
def test_of_free_columns_it_is_equation_6(m, n):
    expected = measures.sigma_bound(m, n, 4.0 * n)
    for model in ("free(norm=2)", "free-mean(norm=2)"):
        assert relaxed(lj.arm(model, n, m)).value == pytest.approx(expected, rel=1e-10)


VALUES = [
    ("unit-revolute:7", 0.57735027),
    ("unit-revolute:5,prismatic:2", 0.52583696),
    ("lever-revolute(length=3):7", 0.73991897),
    ("unit-revolute:4,prismatic:3", 0.48938432),
    ("lever-revolute-each(length=0.3):4,lever-revolute-each(length=2):4", 0.92907428),
]


@pytest.mark.parametrize(("spec", "expected"), VALUES)
def test_values_that_were_measured_elsewhere(spec, expected):
    assert relaxed(lj.arm(spec)).value == pytest.approx(expected, abs=2e-8)


ISOTROPIC = ["lever-revolute:7,prismatic:1", "lever-revolute:6,prismatic(speed=0.8):2"]


@pytest.mark.parametrize("spec", ISOTROPIC)
def test_of_isotropic_arms_it_is_the_closed_form(spec):
    arm = lj.arm(spec)
    closed = np.sqrt(isotropic_bound(arm))
    assert closed * (1 - 1e-12) <= relaxed(arm, 1, "isotropy").value <= closed * (1 + LOSS)


def test_rows_whose_traces_differ_bound_the_residual():
    """4 revolute and 3 prismatic joints: tr M_vv = 7 and tr M_ωω = 4."""
    found = relaxed(lj.arm("unit-revolute:4,prismatic:3"), 1, "residual").value
    assert 0.75 - 1e-9 < found <= 0.75
    assert lj.bound("residual", lj.arm("unit-revolute:4,prismatic:3")).value == found
    assert np.isnan(lj.bound("isotropy", lj.arm("unit-revolute:4,prismatic:3")).value)


def test_screws_have_a_bound_that_no_closed_form_gives():
    arm = lj.arm("rotor:8")
    assert (
        relaxed(arm).value < np.sqrt(measures.eigenvalue_bound(6, 8, arm.largest_trace)) - 1e-3
    )
    assert relaxed(arm, 1, "residual").value == pytest.approx(8 / 150, rel=1e-6)


KINDS = ("unit-revolute", "lever-revolute", "lever-revolute-each(length=0.4)", "prismatic")
ARMS = st.lists(st.tuples(st.sampled_from([*KINDS, "rotor"]), st.integers(1, 4)), min_size=2)


@settings(max_examples=10)
@given(ARMS, st.integers(0, 2**32 - 1))
def test_no_jacobian_is_above_it(parts, seed):
    revolute = "unit-revolute:5"
    arm = lj.arm(",".join([revolute, *(f"{kind}:{count}" for kind, count in parts[:3])]))
    matrix = arm.jacobian(arm.sample(np.random.default_rng(seed)))
    m, n = arm.shape
    for failures in range(1, min(2, n - m) + 1):
        assert measures.worst_case_sigma(matrix, failures) <= relaxed(arm, failures).value
    assert measures.isotropy_defect(matrix) >= relaxed(arm, 1, "residual").value - 1e-12


UNEVEN = ["unit-revolute:9", "lever-revolute:5,lever-revolute(length=0.5):4", "free-mean:8"]


@settings(max_examples=12)
@given(st.sampled_from(UNEVEN), st.integers(0, 2**32 - 1))
def test_unequal_failures_are_not_above_it(spec, seed):
    """Joints that share a bound on the mean may fail with different probabilities."""
    rng = np.random.default_rng(seed)
    arm = lj.arm(spec)
    odds = rng.choice([0.02, 0.1, 0.4], arm.shape[1])
    failures = FailureModel(tuple(odds.tolist()))
    matrix = arm.jacobian(arm.sample(rng))
    assert weighted_worst_case(matrix, failures)[0] <= relaxed(arm, failures).value


def test_a_joint_that_fails_often_is_best_left_out_and_the_bound_is_attained():
    arm, failures = lj.arm("free-mean", 4, 2), FailureModel((0.3, 0.05, 0.05, 0.05))
    best = lj.solve("max-min", arm, failures=failures, starts=10, workers=1).best
    assert best.score == pytest.approx(relaxed(arm, failures).value, rel=1e-7)
    proof = relaxed(arm, failures).proof
    first, second = proof.conditions
    torn = replace(proof, conditions=(tuple(2 * x for x in first), second))
    with pytest.raises(CertificateError, match="norm has more than one multiplier"):
        torn.check()


def test_it_is_the_same_in_any_order_and_in_other_units():
    first = relaxed(lj.arm("unit-revolute:5,prismatic(speed=0.5):2,lever-revolute:1"))
    second = relaxed(lj.arm("lever-revolute:1,prismatic(speed=0.5):2,unit-revolute:5"))
    assert first.value == pytest.approx(second.value, rel=1e-9)
    metres, millimetres = (relaxed(lj.arm(f"free(norm={one})", 7, 6)) for one in (0.5, 500.0))
    assert 1000 * metres.value == pytest.approx(millimetres.value, rel=1e-10)


@pytest.mark.parametrize(
    "spec", ["unit-revolute:10", "lever-revolute(length=0.3):9", "rotor:10"]
)
def test_more_failures_never_leave_more(spec):
    values = [relaxed(lj.arm(spec), k).value for k in (1, 2, 3)]
    assert values == sorted(values, reverse=True)
    known = [lj.bound("max-min", lj.arm(spec), k).value for k in (1, 2, 3)]
    assert known == sorted(known, reverse=True)
    assert all(limit <= value for limit, value in zip(known, values, strict=True))


def test_the_program_is_one_of_cvxpy_whose_parts_have_names():
    problem = relaxation.build(lj.arm("unit-revolute:5,prismatic:2"))
    assert isinstance(problem, cp.Problem)
    assert {one.name() for one in problem.variables()} == {
        *("s", "X 0", "X 1"),
        *("Y all", "Y linear", "Y rotational"),
    }
    assert list(problem.named) == [
        *("joint 0: |v| = 1", "joint 0: |ω| = 1", "joint 0: v·ω"),
        "joint 1: speed",  # its rows ω are left out
        *("failure (1, 0)", "failure (0, 1)"),
        *("inverse, all", "all failures, all"),
        *("inverse, linear", "all failures, linear"),
        *("inverse, rotational", "all failures, rotational"),
    ]
    assert [one.shape for one in problem.variables() if one.name() == "X 1"] == [(3, 3)]
    reached = {block.name: block.joints for block in problem.parts.blocks}
    assert reached == {"all": 7, "linear": 7, "rotational": 5}


def test_joints_that_never_fail_leave_out_sums_that_they_reach():
    arm = lj.arm("unit-revolute:7,prismatic:1")
    problem = relaxation.build(arm, FailureModel.equally_likely(8, 1, never=(7,)))
    assert [block.name for block in problem.parts.blocks] == ["rotational"]


@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
def test_any_solver_of_cvxpy_serves(solver):
    found = relaxed(lj.arm("unit-revolute:8"), solver=solver)
    assert found.value == pytest.approx(np.sqrt(2 / 3), rel=1e-6)
    assert found.value >= np.sqrt(2 / 3)
    plain = found.to_dict()
    assert (plain["solver"], plain["kind"]) == (solver, "proved (relaxation)")
    assert plain["dual_residual"] < 1e-4
    assert plain["smallest_eigenvalue"] > -1e-4
    assert plain["seconds"] > 0


def test_a_second_try_with_a_larger_tolerance_is_said():
    outcomes = [relaxed(lj.arm(f"unit-revolute:7,lever-revolute:{n}"), 2) for n in (2, 3, 4)]
    for found in outcomes:
        assert ("status_of_first_run" in found.to_dict()) == bool(found.failed)
        assert found.solution.status in ("optimal", "optimal_inaccurate")


def test_a_solver_that_is_missing_fails_or_stops_is_refused():
    arm = lj.arm("unit-revolute:8")
    with pytest.raises(InputError, match="solver is NONE; allowed: one of CLARABEL"):
        relaxed(arm, solver="NONE")
    with pytest.raises(InputError, match="solver is SCIPY; allowed: one of CLARABEL, SCS"):
        relaxed(arm, solver="SCIPY")
    with pytest.raises(CertificateError, match=r"no multipliers: solver_error: .*'colour'"):
        relaxed(arm, options={"colour": 1})
    with pytest.raises(CertificateError, match="CLARABEL has no multipliers: user_limit"):
        relaxed(arm, options={"max_iter": 1})


def test_where_too_few_joints_are_left_that_is_said():
    with pytest.raises(CertificateError, match="too few joints for rotational rows: σ is 0"):
        relaxed(lj.arm("unit-revolute:3,prismatic:5"))
    assert lj.bound("max-min", lj.arm("unit-revolute:3,prismatic:5")).value == 0


@pytest.mark.parametrize("length", [1e-40, 1e-6, 1e-3, 1e3, 1e6, 1e70])
def test_lengths_may_be_in_any_unit(length):
    """The smaller rows alone have tr (M/t − I)⁻¹ ≤ 2: 3t = 2(8/3·ℓ² − t), with ℓ at most 1."""
    found = relaxed(lj.arm(f"lever-revolute(length={length})", 8)).value
    assert found == pytest.approx(np.sqrt(16 / 15) * min(length, 1), rel=3e-7)


MANY = lj.Arm(tuple(lj.LeverRevolute(0.1 + 0.05 * k, "each") for k in range(40)))


def test_many_kinds_share_what_differs_in_limits_alone():
    closed = np.sqrt(spatial_bound(MANY))
    assert closed * (1 - 1e-12) <= relaxed(MANY).value <= closed * (1 + LOSS)
    few = lj.Arm(MANY.joints[:8])
    coarse = prove(relaxation.solve(relaxation.build(few, coarse=True))).bound
    assert coarse >= relaxed(few).value * (1 - 1e-10)
    assert len(parts_of(MANY, coarse=True).kinds) == 1


def test_what_is_too_large_has_the_bounds_that_need_no_program():
    with pytest.raises(InputError, match="task dimension is 13; allowed: at most 12"):
        relaxed(lj.arm("free", 15, 13))
    assert lj.bound("max-min", lj.arm("free", 15, 13)).kind == "closed form"
    unequal = FailureModel(tuple(np.linspace(0.01, 0.2, 20)))
    with pytest.raises(InputError, match="different failures is 20; allowed: at most 16"):
        relaxed(lj.Arm(MANY.joints[:20]), unequal)


@pytest.mark.parametrize(
    ("spec", "value"),
    [
        ("lever-revolute:6,prismatic(speed=2):1", 0.0),
        ("unit-revolute:8,prismatic(speed=0.01):1", np.sqrt(2 / 3)),
    ],
)
def test_where_no_jacobian_is_isotropic_and_of_full_rank_the_closed_form_holds(spec, value):
    with pytest.raises(CertificateError, match="infeasible"):
        relaxed(lj.arm(spec), 1, "isotropy")
    assert lj.bound("isotropy", lj.arm(spec)).value == pytest.approx(value, abs=1e-12)


def test_unequal_failures_have_the_sharper_of_two_bounds():
    arm, failures = lj.arm("free", 4, 2), FailureModel((0.3, 0.05, 0.05, 0.05))
    known = certified.largest_weighted_worst_case(arm, failures)
    closed = weighted_worst_bound(2, [1.0] * 4, failures)
    assert known.value == pytest.approx(min(closed, relaxed(arm, failures).value), rel=1e-12)


# A joint of a user's own.


@dataclass(frozen=True)
class Short(lj.UnitRevolute):
    """A revolute joint whose conditions are replaced."""

    gram_conditions = (trace_condition("|ω| = 1", 6, slice(3, 6), 1.0),)


@dataclass(frozen=True)
class Plain(lj.UnitRevolute):
    """A revolute joint of which only the norm is said."""

    gram_conditions = lj.Joint.gram_conditions


def test_a_joint_of_a_users_own_is_bounded_by_its_norm():
    found = relaxed(lj.Arm.of(Plain(), 8)).value
    assert found == pytest.approx(np.sqrt(2 / 3), rel=1e-9)
    assert lj.bound("max-min", lj.Arm.of(Plain(), 8)).kind == "closed form"


def squares(*weights):
    """The matrix of a weighted sum of squares of a column's entries."""
    return tuple(map(tuple, np.diag(np.array(weights, dtype=float)).tolist()))


def test_a_condition_with_both_signs_does_not_say_that_rows_are_zero():
    """|v|² = |ω|², as of unit revolute joints, does not mean that ω is 0."""
    both = GramCondition("|v| = |ω|", squares(1, 1, 1, -1, -1, -1), 0.0)

    @dataclass(frozen=True)
    class Equal(lj.UnitRevolute):
        gram_conditions = (trace_condition("norm", 6, slice(None), 2.0), both)

    arm = lj.Arm.of(Equal(), 8)
    reached = [block.joints for block in parts_of(arm).blocks]
    assert reached == [8, 8, 8]
    assert relaxed(arm).value == pytest.approx(np.sqrt(2 / 3), rel=1e-9)


@pytest.mark.parametrize(
    "conditions",
    [
        *((), None, [1], (1,)),
        (trace_condition("short", 5, slice(None), 1.0),),
        (trace_condition("limit", 6, slice(None), np.nan),),
        (trace_condition("nothing", 6, slice(0, 0), 1.0),),
        (GramCondition("flat", ((1.0,) * 6,), 1.0),),
        (GramCondition("words", squares(1, 1, 1, 1, 1, 1), "2"),),
    ],
)
def test_what_is_no_condition_is_refused_in_a_sentence(conditions):
    @dataclass(frozen=True)
    class Odd(lj.UnitRevolute):
        gram_conditions = conditions

    for bound in (relaxed, partial(lj.bound, "max-min")):
        with pytest.raises(InputError, match=r"gram_conditions is .*; allowed: one Gram"):
            bound(lj.Arm.of(Odd(), 8))


def test_conditions_that_do_not_bound_a_column_are_refused():
    with pytest.raises(CertificateError, match="do not bound the norm of a column"):
        relaxed(lj.Arm.of(Short(), 8))


# The proof.


def test_the_check_accepts_what_was_found_and_nothing_sharper():
    for spec in ("unit-revolute:7", "rotor:8", "lever-revolute:7,prismatic:1"):
        for statement in ("max-min", "residual"):
            proof = relaxed(lj.arm(spec), 1, statement).proof
            proof.check()
            share = Fraction(1, 10**13)
            sharper = 1 + share if statement == "residual" else 1 - share
            if proof.level > 0:
                with pytest.raises(CertificateError, match="prove"):
                    replace(proof, level=proof.level * sharper).check()


def mutated(proof, rng):
    """The proof with one number changed, at random, and a claim that is sharper by 1e-9."""
    claim = proof.level * (1 - Fraction(1, 10**9))
    factor = Fraction(float(rng.choice([0.0, -1.0, 0.5, 0.999, 1.001, 1.5, 3.0])))
    number = int(rng.integers(4))
    if number == 0:
        kind = int(rng.integers(len(proof.conditions)))
        weights = list(proof.conditions[kind])
        place = int(rng.integers(len(weights)))
        weights[place] = weights[place] * factor if weights[place] else factor
        changed = list(proof.conditions)
        changed[kind] = tuple(weights)
        return replace(proof, conditions=tuple(changed), level=claim)
    if number == 1:
        failure = int(rng.integers(len(proof.failures)))
        matrix = proof.failures[failure].copy()
        i, k = rng.integers(6, size=2)
        matrix[i, k] += factor
        matrix[k, i] = matrix[i, k]
        changed = list(proof.failures)
        changed[failure] = matrix
        return replace(proof, failures=tuple(changed), level=claim)
    block = int(rng.integers(len(proof.sums)))
    one = proof.sums[block]
    if number == 2:
        one = replace(one, weight=one.weight * factor if one.weight else factor)
    else:
        inverse = one.inverse.copy()
        i, k = rng.integers(len(inverse), size=2)
        inverse[i, k] = inverse[i, k] * factor if inverse[i, k] else factor
        one = replace(one, inverse=inverse)
    changed = list(proof.sums)
    changed[block] = one
    return replace(proof, sums=tuple(changed), level=claim)


@pytest.mark.parametrize("spec", ["unit-revolute:7", "unit-revolute:5,prismatic:2", "rotor:8"])
def test_mutants_that_claim_more_are_refused(spec):
    """No mutant proves more than 1e-9 more: the relaxation's value is a maximum."""
    rng = np.random.default_rng(7)
    proof = prove(relaxation.solve(relaxation.build(lj.arm(spec))))
    for _ in range(60):
        with pytest.raises(CertificateError):
            mutated(proof, rng).check()


def test_a_claim_about_another_arm_is_refused():
    proof = relaxed(lj.arm("unit-revolute:8")).proof
    other = parts_of(lj.arm("unit-revolute:9"))
    with pytest.raises(CertificateError):
        replace(proof, parts=other).check()


PROOF = prove(relaxation.solve(relaxation.build(lj.arm("unit-revolute:8"))))
ZERO = Fraction(0)
DAMAGED = {
    "statement": "worst",
    "level": 0.5,
    "conditions": (),
    "failures": (),
    "sums": (),
    "isotropic": np.zeros((6, 6)),
    "norms": ((ZERO,),),
}


@pytest.mark.parametrize(("name", "value"), DAMAGED.items())
def test_multipliers_that_are_no_fractions_or_not_as_many_are_refused(name, value):
    with pytest.raises(CertificateError):
        replace(PROOF, **{name: value}).check()


@pytest.mark.parametrize("level", [np.nan, np.inf, 1, "1", None])
def test_a_claim_is_a_fraction(level):
    with pytest.raises(CertificateError, match="level is not a fraction"):
        replace(PROOF, level=level).check()


def test_matrices_of_other_shapes_are_refused():
    block = PROOF.sums[1]
    small = block.inverse[:2, :2]
    for one in (
        {"failures": (PROOF.failures[0][:5, :5],)},
        {"failures": (PROOF.failures[0].astype(float),)},
        {"isotropic": PROOF.isotropic[:5, :5]},
        {"sums": (PROOF.sums[0], replace(block, inverse=small), PROOF.sums[2])},
        {"sums": (PROOF.sums[0], replace(block, point=small), PROOF.sums[2])},
        {"sums": (PROOF.sums[0], replace(block, weight=1.0), PROOF.sums[2])},
    ):
        with pytest.raises(CertificateError):
            replace(PROOF, **one).check()


def test_parts_that_are_of_no_arm_are_refused():
    parts = PROOF.parts
    kind, failure = parts.kinds[0], parts.sets[0]
    for one in (
        {"kinds": (replace(kind, count=0),)},
        {"sets": (replace(failure, weight=np.inf),)},
        {"sets": (replace(failure, counts=(2,)),)},
        {"units": (1.0,) * 5},
        {"units": (0.5,) * 6},
    ):
        with pytest.raises(CertificateError):
            replace(PROOF, parts=replace(parts, **one)).check()


def test_a_joint_that_does_not_lock_has_no_norm_to_multiply():
    proof = relaxed(lj.arm("unit-revolute:7,lever-revolute:1"), 1, "isotropy").proof
    first, second = proof.parts.sets
    assert (first.counts, second.counts) == ((1, 0), (0, 1))
    wrong = ((proof.norms[0][0], Fraction(1, 7)), proof.norms[1])
    with pytest.raises(CertificateError, match="does not lock has a multiplier"):
        replace(proof, norms=wrong).check()


def test_a_bound_is_shown_short_and_with_all_its_digits():
    found = relaxed(lj.arm("free", 3, 2))
    solver = f"{found.solution.solver} {found.solution.status}"
    assert repr(found) == f"<Relaxed: {found.value!r}, proved (relaxation), {solver}>"
