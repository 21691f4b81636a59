"""What docs/nonexistence.md says is true: its program runs, its numbers come out."""

import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

from formulations.existence.derive import rewriting, squared_polynomials
from formulations.existence.equations import (
    ONE,
    Frame,
    Monomial,
    canonical,
    class_sums,
    hermitian_product,
)

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def page():
    return (ROOT / "docs" / "nonexistence.md").read_text()


@pytest.mark.long
def test_the_program_on_the_page_proves_the_identity(page):
    found = re.search(r"```python\n(.*?)```", page, re.DOTALL)
    assert found is not None
    run = subprocess.run(
        [sys.executable, "-c", found[1]], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout == (
        "The identity holds: no optimally failure-tolerant 7R Jacobian exists.\n"
    )


@pytest.mark.parametrize(
    ("graph", "value"),
    [
        (Monomial(((0, 1),), ((0, 1),)), Fraction(2, 7)),
        (Monomial(((0, 2),), ((0, 1),)), Fraction(-2, 35)),
        (Monomial(((0, 1),), ((2, 3),)), Fraction(1, 35)),
        (Monomial(((0, 1), (0, 1)), ((0, 1), (0, 1))), Fraction(2, 21)),
        (Monomial(((0, 1), (0, 2)), ((0, 1), (0, 2))), Fraction(58, 735)),
        (Monomial(((0, 1), (2, 3)), ((0, 1), (2, 3))), Fraction(61, 735)),
    ],
)
def test_the_table_of_averages(graph, value, page):
    equations = rewriting(Frame(7, 6), 2)
    assert equations.divide({canonical(graph): Fraction(1)})[1] == {ONE: value}
    assert str(value).replace("-", "−") in page


def test_the_two_affine_functions_of_tau(seven, page):
    p, q = (seven.divide(class_sums(hermitian_product(s, s)))[1] for s in squared_polynomials())
    (triangle,) = p.keys() - {ONE}
    assert (p[ONE], p[triangle] / 35) == (Fraction(32488, 7203), Fraction(-40, 7))
    assert (q[ONE], q[triangle] / 35) == (Fraction(-748288, 36015), Fraction(864, 35))
    assert 108 * p[ONE] + 25 * q[ONE] == Fraction(-33248, 1029)
    # τ has an upper bound below its lower one.
    assert -35 * p[ONE] / p[triangle] == Fraction(28427, 36015)
    assert -35 * q[ONE] / q[triangle] == Fraction(163688, 194481)
    for text in (
        r"|p_1|^2 = \frac{32488}{7203} - \frac{40}{7} \tau",
        r"|q|^2 = \frac{864}{35} \tau - \frac{748288}{36015}",
        r"= -\frac{33248}{1029} < 0",
    ):
        assert text in page


def test_decimals_of_the_two_bounds(page):
    bounds = re.findall(r"\\tau \\[lg]e \\frac{(\d+)}{(\d+)} ", page)
    assert len(bounds) == 2
    for numerator, denominator in bounds:
        decimals = int(100_000 * Fraction(int(numerator), int(denominator)))
        assert rf"= 0.{decimals}\dots" in page
