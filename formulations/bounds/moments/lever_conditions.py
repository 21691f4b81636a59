"""What isotropic lever arms imply for the unit revolute Jacobian with the same directions.

J has the columns (v_i; ω_i) of n revolute joints, |ω_i| = 1, v_i·ω_i = 0 and any |v_i|. Let J'
have the columns (v_i/|v_i|; ω_i), those of unit revolute joints, and E = J'J'ᵀ − (n/3)I with
the 3×3 blocks E_v (linear rows and columns), E_x (linear rows, rotational columns) and E_w
(rotational ones). If J is isotropic, E_w = 0. A common phase of all joints hides that. What is
left whatever the phase is, docs/bounds.md, section 5, says of

    H = E_v + E_w,   C = E_v − E_w + i(E_x + E_xᵀ),   K = E_x − E_xᵀ,

all of shape (3, 3), with Frobenius norms:

- ‖C‖² ≥ ‖H‖², the condition ``turned``;
- |tr HC|² ≥ ‖H‖⁴, the condition ``aligned``;
- the `lever_defect` is small where a worst case is good, the condition ``narrow``.

In the code J' is the `jacobian`, shape (…, 6, n); results are matrices with one entry, shape
(…, 1, 1), and bounds on their errors. Nothing has a unit.

Search and verifier both evaluate the conditions here, with bounds on the error.
"""

from math import inf, nextafter
from typing import NamedTuple

import numpy as np

from lockedjoint.formulations.bounds.moments.conditions import (
    Conditions,
    WorstCaseCondition,
)
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.revolute_exclusions import (
    LEVER_LIMIT,
    SKEW_WEIGHT,
    SYMMETRIC_WEIGHT,
)

# Size of the conditions ``turned`` and ``narrow`` that counts as 1. It is near that at random
# configurations. Any number is correct; certificates on record hold for these.
_TURNED_UNIT = 16
# The same of the condition ``aligned``.
_ALIGNED_UNIT = 256


class _PhaseForms(NamedTuple):
    """Numbers that a common phase of all joints keeps, each of shape (…, 1, 1)."""

    #: ‖H‖².
    plain: EnclosedMatrix
    #: ‖C‖².
    turning: EnclosedMatrix
    #: ‖K‖².
    skew: EnclosedMatrix
    #: |tr HC|².
    alignment: EnclosedMatrix


def _phase_forms(jacobian: EnclosedMatrix) -> _PhaseForms:
    """Return ‖H‖², ‖C‖², ‖K‖² and |tr HC|² of J', shape (…, 6, n).

    C has the real part `real` and the imaginary part `imaginary`. As H is real and all of them
    are symmetric, tr HC = ⟨H, real⟩ + i⟨H, imaginary⟩.
    """
    v = EnclosedMatrix(jacobian.values[..., :3, :], jacobian.errors)
    w = EnclosedMatrix(jacobian.values[..., 3:, :], jacobian.errors)
    mean = np.longdouble(jacobian.values.shape[-1]) / 3
    identity = EnclosedMatrix.exact(np.eye(3), jacobian).times(2 * mean)
    vv, ww, vw = v @ v.transposed, w @ w.transposed, v @ w.transposed
    plain, real = vv + ww - identity, vv - ww
    imaginary, skew = vw + vw.transposed, vw - vw.transposed
    first, second = plain.inner(real), plain.inner(imaginary)
    return _PhaseForms(
        plain.inner(plain),
        real.inner(real) + imaginary.inner(imaginary),
        skew.inner(skew),
        first.inner(first) + second.inner(second),
    )


def lever_defect(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return ½‖H‖² + a(‖C‖² − ‖H‖²) + b‖K‖², shape (…, 1, 1).

    a is `SYMMETRIC_WEIGHT` and b is `SKEW_WEIGHT` of `revolute_exclusions`.
    """
    forms = _phase_forms(jacobian)
    turned = (forms.turning - forms.plain).times(float(SYMMETRIC_WEIGHT))
    return forms.plain.times(0.5) + turned + forms.skew.times(float(SKEW_WEIGHT))


def lever_conditions() -> Conditions:
    """Return the conditions that are ≥ 0, in their units, by their names."""

    def turned(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        forms = _phase_forms(jacobian)
        return (forms.turning - forms.plain).times(1 / _TURNED_UNIT)

    def aligned(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        forms = _phase_forms(jacobian)
        return (forms.alignment - forms.plain.inner(forms.plain)).times(1 / _ALIGNED_UNIT)

    def narrow(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        # A little above the limit, whatever its rounding.
        limit = EnclosedMatrix.exact([[nextafter(float(LEVER_LIMIT), inf)]], jacobian)
        return (limit - lever_defect(jacobian)).times(1 / _TURNED_UNIT)

    return {
        "narrow": WorstCaseCondition("narrow", narrow),
        "turned": WorstCaseCondition("turned", turned),
        "aligned": WorstCaseCondition("aligned", aligned),
    }
