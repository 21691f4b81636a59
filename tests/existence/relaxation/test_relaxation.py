"""The sizes, ranks and margins of orders 2 and 3, and what perturbed multipliers prove."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from formulations.existence.relaxation import relaxation
from formulations.existence.relaxation.margin import check_margin, solve_margin
from formulations.existence.relaxation.relaxation import (
    ExistenceRelaxation,
    existence_relaxation,
)
from nlp.errors import InputError


def test_order_1_is_feasible() -> None:
    found = existence_relaxation(1)
    assert found.verdict == "feasible"
    assert found.moments.free == ()


def test_order_2_determines_every_moment_and_is_feasible(order_2: ExistenceRelaxation) -> None:
    moments, margin = order_2.moments, order_2.margin
    assert len(moments.classes) == 43
    assert moments.equations == 85
    assert moments.rank == 42
    assert moments.free == ()
    assert order_2.verdict == "feasible"
    assert margin is not None
    assert margin.status == "optimal"
    # Nothing is free, so the margin is the smallest eigenvalue, in the (4, 3) block.
    assert margin.certificate.attained == pytest.approx(0.00453514739, abs=1e-10)
    assert margin.value == pytest.approx(0.00453514739, abs=1e-7)
    lowest = [np.linalg.eigvalsh(block.matrices[0])[0] for block in order_2.blocks]
    assert min(lowest) == pytest.approx(margin.certificate.attained)
    assert not any(one.certificate.infeasible for one in order_2.alone)


def test_order_3_has_the_sizes_and_ranks_of_the_theory(order_3: ExistenceRelaxation) -> None:
    moments = order_3.moments
    assert len(moments.classes) == 760
    assert moments.equations == 2430
    assert moments.rank == 757
    assert len(moments.free) == 2
    assert max(block.size for block in order_3.blocks) == 7
    assert order_3.rank_doubt < 1e-9
    sizes = {block.shape: block.size for block in order_3.blocks if block.charge == 1}
    assert [sizes[shape] for shape in ((4, 2, 1), (3, 3, 1), (3, 2, 2))] == [7, 4, 5]


def test_order_3_is_infeasible_with_the_margin(order_3: ExistenceRelaxation) -> None:
    margin = order_3.margin
    assert order_3.verdict == "infeasible"
    assert margin is not None
    assert margin.value == pytest.approx(-0.0178404, abs=1e-6)
    assert margin.certificate.attained == pytest.approx(-0.0178404, abs=1e-6)
    assert margin.certificate.attained < margin.certificate.proved < -0.01783
    assert margin.certificate.residual < 1e-6
    assert margin.certificate.smallest_eigenvalue > -1e-9


def test_three_blocks_are_infeasible_alone(order_3: ExistenceRelaxation) -> None:
    alone = {
        (block.charge, block.shape)
        for block, margin in zip(order_3.blocks, order_3.alone, strict=True)
        if margin.certificate.infeasible
    }
    assert alone == {(1, (4, 2, 1)), (1, (3, 3, 1)), (1, (3, 2, 2))}
    feasible = [m for m in order_3.alone if not m.certificate.infeasible]
    assert all(margin.certificate.attained > 0 for margin in feasible)


def test_without_the_infeasible_blocks_order_3_is_feasible(
    order_3: ExistenceRelaxation,
) -> None:
    others = [block for block in order_3.blocks if block.charge != 1]
    margin = solve_margin(others, order_3.moments.limits())
    assert margin.certificate.feasible


def test_perturbed_multipliers_prove_no_more_than_the_truth(
    order_3: ExistenceRelaxation,
) -> None:
    margin, limits = order_3.margin, order_3.moments.limits()
    assert margin is not None
    assert margin.multipliers is not None
    rng = np.random.default_rng(0)
    for noise in (1e-6, 1e-4, 1e-2, 1.0):
        perturbed = [x + noise * rng.standard_normal(x.shape) for x in margin.multipliers]
        certificate = check_margin(order_3.blocks, limits, margin.free, perturbed)
        assert certificate.proved >= margin.certificate.attained
        if noise >= 1e-2:
            assert not certificate.infeasible
    negated = [-x for x in margin.multipliers]
    assert not check_margin(order_3.blocks, limits, margin.free, negated).infeasible
    missing = check_margin(order_3.blocks, limits, None, None)
    assert not missing.infeasible
    assert not missing.feasible


def test_a_solver_cut_short_is_reported_and_decides_nothing() -> None:
    found = existence_relaxation(2, 6, options={"max_iter": 1})
    assert found.verdict == "undecided"
    assert found.margin is not None
    assert found.margin.status not in ("optimal", "optimal_inaccurate")
    assert json.dumps(found.to_dict(), allow_nan=False)


def test_the_result_is_plain_json(order_3: ExistenceRelaxation) -> None:
    shown = json.loads(json.dumps(order_3.to_dict(), allow_nan=False))
    assert shown["kind"] == "numerical"
    assert (shown["classes"], shown["equations"], shown["rank"]) == (760, 2430, 757)
    assert len(shown["free_moments"]) == 2
    assert shown["largest_block"] == 7
    assert shown["verdict"] == "infeasible"
    assert sum(block["infeasible_alone"] for block in shown["blocks"]) == 3


def test_an_unknown_solver_is_refused_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(relaxation, "solve_moment_equations", None)
    with pytest.raises(InputError, match="solver is NONE"):
        existence_relaxation(3, solver="NONE")


@pytest.mark.parametrize(
    ("order", "joints", "task_dimension", "argument"),
    [(0, 7, None, "order"), (4, 7, None, "order"), (2, 1, None, "joints")]
    + [(2, 8, None, "joints"), (2, 7, 4, "task_dimension"), (2, 6, 5, "task_dimension")],
)
def test_bad_input_is_named(
    order: int, joints: int, task_dimension: int | None, argument: str
) -> None:
    with pytest.raises(InputError) as caught:
        existence_relaxation(order, joints, task_dimension=task_dimension)
    assert caught.value.argument == argument


def test_the_verdict_rests_on_the_certificate_alone(order_2: ExistenceRelaxation) -> None:
    assert order_2.margin is not None
    unproved = check_margin(order_2.blocks, np.zeros(0), None, None)
    unfounded = replace(order_2.margin, value=-1.0, status="optimal", certificate=unproved)
    assert replace(order_2, margin=unfounded).verdict == "undecided"
