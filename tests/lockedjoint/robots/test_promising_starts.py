"""Where searches for a posture begin."""

import numpy as np
import pytest

from lockedjoint.nlp.starts import generator
from lockedjoint.robots.posture_search import searched
from lockedjoint.robots.promising_starts import promising_starts
from lockedjoint.robots.search import Search


@pytest.fixture
def planar(made):
    return made.planar([1.0, 0.7, 0.5, 0.4])


def starts(arm, indices):
    return promising_starts(arm, [generator(5, k) for k in indices])


def test_a_start_depends_on_its_own_generator_only(planar):
    together = starts(planar, range(70))  # more than are looked for together
    np.testing.assert_allclose(starts(planar, [68]), together[68:69], rtol=0, atol=1e-9)
    assert len(np.unique(together.round(6), axis=0)) == 70


def test_a_start_is_better_than_anything_drawn_and_keeps_the_limits(planar):
    found = starts(planar, range(20))
    values = planar.worst_case(found)[0]
    for k, value in enumerate(values):
        drawn = planar.samples(generator(5, k), 192)
        assert value > planar.worst_case(drawn)[0].max()
    lower, upper = planar.bounds
    assert np.all((found >= lower) & (found <= upper))


def test_most_starts_of_a_small_arm_are_next_to_an_optimum(planar):
    found = searched(planar, Search(starts=20))
    values = planar.worst_case(starts(planar, range(20)))[0]
    assert np.sum(values > 0.99 * found.best.worst_case_sigma) >= 15
