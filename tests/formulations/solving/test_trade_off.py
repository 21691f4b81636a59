"""Between isotropy and max-min: the ends are those statements' own, and more room is better."""

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.solving.trade_off_curve import trade_off_curve

# ½‖JJᵀ − (n/3)I‖² and σ at the ends, as results/comparison has them from 100 starts each.
ENDS = {
    "unit-revolute": ((0.0568265, 0.519856), (0.282917, 0.571483)),
    "lever-revolute": ((0.0, 0.480383), (0.126921, 0.574649)),
}


@pytest.fixture(scope="module", params=ENDS)
def swept(request):
    return request.param, trade_off_curve(arm(request.param, 7), points=5, starts=3, seed=4)


def test_the_ends_are_the_known_ones(swept):
    model, points = swept
    for point, (defect, sigma) in zip((points[0], points[-1]), ENDS[model], strict=True):
        assert point.isotropy_defect == pytest.approx(defect, abs=2e-6)
        assert point.worst_case_sigma == pytest.approx(sigma, abs=2e-6)
    statement = {"unit-revolute": "residual", "lever-revolute": "isotropy"}[model]
    assert (points[0].statement, points[-1].statement) == (statement, "max-min")


def test_a_larger_defect_buys_a_better_worst_case(swept):
    _, points = swept
    sigmas = [point.worst_case_sigma for point in points]
    assert len(points) == 5
    assert np.all(np.diff(sigmas) > 1e-3)
    # Concave in the distance from isotropy: the first steps buy most.
    away = np.sqrt([2 * point.isotropy_defect for point in points])
    slopes = np.diff(sigmas) / np.diff(away)
    assert np.all(np.diff(slopes) < 0)


def test_points_are_what_they_say(swept):
    model, points = swept
    seven = arm(model, 7)
    for point in points:
        seven.variables(point.jacobian)
        assert measures.worst_case_sigma(point.jacobian) == point.worst_case_sigma
        assert measures.isotropy_defect(point.jacobian) == point.isotropy_defect
    for point in points[1:-1]:
        # The limit is used up: more of it would be better.
        assert point.isotropy_defect == pytest.approx(point.limit, rel=1e-4)
        assert point.isotropy_defect <= point.limit * (1 + 1e-6)


def test_where_the_optimum_is_isotropic_there_is_no_trade_off():
    [first, last] = trade_off_curve(arm("free", 3, 2), points=4, starts=2)
    assert first.worst_case_sigma == pytest.approx(last.worst_case_sigma, abs=1e-6)
    assert first.isotropy_defect == pytest.approx(0, abs=1e-9)
