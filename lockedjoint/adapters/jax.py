"""For JAX: see `formulations.adapters.jax`."""

from formulations.adapters.jax import jacobian as jacobian
from formulations.adapters.jax import smooth_worst_case as smooth_worst_case
from formulations.adapters.jax import worst_case as worst_case
