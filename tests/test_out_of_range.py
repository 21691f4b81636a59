"""What is out of range is refused with the argument's name, before any work."""

from math import inf, nan

import pytest

from formulations.bounds.closed_form import block_trace_bound
from formulations.bounds.planar import planar_bound
from formulations.bounds.two_point import two_point_bound
from formulations.measures import eigenvalue_bound
from nlp.errors import InputError

ONE_EACH = "sizes is .* one positive size for each trace"
CASES = [
    *((eigenvalue_bound, (6, 7, trace), "trace is") for trace in (-1.0, nan, inf)),
    (eigenvalue_bound, (6, 6, 1.0), "joints is 6"),
    (eigenvalue_bound, (0, 7, 1.0), "task dimension is 0"),
    (block_trace_bound, (7, (), ()), ONE_EACH),
    (block_trace_bound, (7, (3,), (1, 2)), ONE_EACH),
    (block_trace_bound, (7, (3, 0), (1, 1)), ONE_EACH),
    (block_trace_bound, (6, (3, 3), (1.0, 1.0)), "joints is 6"),
    *((block_trace_bound, (7, (3, 3), (1.0, t)), "traces is") for t in (0.0, -1.0, nan)),
    (planar_bound, (2, 1, 1.0), "joints is 2"),
    (planar_bound, (5, 4, 1.0), "locked is 4"),
    (planar_bound, (5, 2, 0.0), "level is 0"),
    (planar_bound, (5, 2, nan), "level is nan"),
    (planar_bound, (5, 2, 1.0, "residual"), "measure is residual"),
    (two_point_bound, (1, 5), "task dimension is 1"),
    (two_point_bound, (3, 4), "joints is 4"),
    (two_point_bound, (2, 61), "joints is 61"),
    (two_point_bound, (13, 20), "task dimension is 13"),
]


@pytest.mark.parametrize(("bound", "arguments", "said"), CASES)
def test_bad_input_is_named(bound, arguments, said):
    with pytest.raises(InputError, match=said):
        bound(*arguments)
