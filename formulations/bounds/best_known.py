"""The best values that Jacobians are known to reach, from the data file ``best_known.json``."""

from __future__ import annotations

import json
from functools import lru_cache
from importlib.resources import files


def best_known(quantity: str, model: str, joints: int) -> float | None:
    """Return the best known value of a quantity in six task dimensions.

    Parameters
    ----------
    quantity
        ``residual``, the smallest ½‖JJᵀ − (n/3)I‖_F²; or ``max-min``, the largest worst-case
        singular value, eq. (5), when one joint locks.
    model
        Column model, a name in `formulations.catalogue.MODELS`.
    joints
        Number of joints n.

    Returns
    -------
    float or None
        The value, ``found`` ones rounded as the file has them; None if none is recorded.
    """
    return _recorded().get((quantity, model, joints))


@lru_cache(maxsize=1)
def _recorded() -> dict[tuple[str, str, int], float]:
    text = files("formulations.bounds").joinpath("best_known.json").read_text("utf-8")
    return {
        (one["quantity"], one["model"], one["joints"]): float(one["value"])
        for one in json.loads(text)
    }
