"""The largest s with every block ⪰ sI: negative where a set of conditions cannot be met.

A moment program whose objective is −s, shifted so that y = 0 is an interior point. Multipliers
X ⪰ 0 with Σ tr X = 1 and Σ ⟨X, B(x)⟩ = d for all x prove s ≤ d; if d < 0, no configuration
meets the conditions, for Σ ⟨X, B(x)⟩ would not be negative there.
"""

from __future__ import annotations

import numpy as np

from formulations.bounds.so3_moments.programs.moment_program import MomentProgram


def margin_program(program: MomentProgram) -> MomentProgram:
    """Return the program whose smallest value is −s; the objective of the given one is left.

    Parameters
    ----------
    program
        The blocks as functions of the pseudo-moments.

    Returns
    -------
    MomentProgram
        With one more unknown, the last.
    """
    lowest = min(float(np.linalg.eigvalsh(block[0])[0]) for block in program.blocks)
    shift = max(0.0, 1.0 - lowest)
    blocks = []
    for block in program.blocks:
        unit = np.eye(block.shape[1])[None]
        blocks.append(np.concatenate([block[:1] + shift * unit, block[1:], -unit]))
    objective = np.zeros(program.moments + 1)
    # The unknown is s + shift.
    objective[0], objective[-1] = shift, -1.0
    return MomentProgram(objective, tuple(blocks))
