"""Random unit tight frames, and exact ones in boxes of a chart."""

import itertools
from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells import charts
from lockedjoint.formulations.bounds.lever_cells.centres import Centres


def random_rows(rng, rounds=300):
    """Return W (3,7) of a frame that is tight up to about 1e-6, by projections in turn."""
    W = rng.normal(size=(3, 7))
    for _ in range(rounds):
        W /= np.linalg.norm(W, axis=0) * np.sqrt(7 / 3)
        u, _, v = np.linalg.svd(W, full_matrices=False)
        W = u @ v
    return W


def random_chart(rng, squared=0.13, least=0.15):
    """Return the chart of a random tight frame, not too near a singular one."""
    while True:
        try:
            chart = charts.tight_chart(random_rows(rng), squared)
        except ValueError:  # too far for Newton's method
            continue
        if chart.least > least:
            return chart


def projections(chart, K):
    """Return P (N,7,7) of the frames of K (N,3,4) in a chart."""
    rho = charts.roots(K)[1]
    W = rho @ (chart.W + K @ chart.F)
    return np.swapaxes(W, 1, 2) @ W


@dataclass
class Exact:
    """Tight frames at places τ of boxes, one each, and which of them were found."""

    tau: np.ndarray
    z: np.ndarray
    K: np.ndarray
    P: np.ndarray
    found: np.ndarray


def exact(chart, t, h, tau, z):
    """Return the tight frames at t + h τ, by Newton's method from z."""
    places = t + h * tau
    z, residual = charts.middles(chart, places, z)
    K = (places @ chart.B + z @ chart.C).reshape(-1, 3, 4)
    found = (residual < 1e-13) & ((K**2).sum((1, 2)) <= chart.greatest**2)
    return Exact(tau, z, K, projections(chart, K), found)


def places(rng, number, axes, alone=False):
    """Yield τ (N,6): corners, then places within; `alone`: along one axis also evenly."""
    N = len(axes)
    for i in range(number):
        tau = rng.uniform(-1, 1, (N, 6))
        if i < number - 4:
            tau = np.sign(tau)
        if alone:
            tau[np.arange(N), axes] = 2 * i / (number - 1) - 1
        yield tau


def surrounded(rng, radius=0.31, away=0.4, number=60):
    """Return as centres a random tight frame and others in random directions around it."""
    first = random_chart(rng)
    t = rng.normal(size=(number, 6))
    t *= away / np.linalg.norm(t, axis=1)[:, None]
    z, residual = charts.middles(first, t, np.zeros_like(t))
    K = (t @ first.B + z @ first.C).reshape(-1, 3, 4)
    others = (first.W + K @ first.F)[residual < charts.RESIDUAL]
    made = Centres.of_frames([first.W, *others], radius)
    assert len(made) > number - 10
    return made


def images(W):
    """Return the frames W (3,7) in all orders and signs of columns, (5040·64,3,7)."""
    orders = np.array(list(itertools.permutations(range(7))))
    signs = np.array([(1, *rest) for rest in itertools.product((1, -1), repeat=6)])
    ordered = np.moveaxis(W[:, orders], 1, 0)
    return (ordered[:, None] * signs[None, :, None]).reshape(-1, 3, 7)


def traces(W, frames):
    """Return tr P P_i = |W W_iᵀ|² for a frame W (3,7) and frames (N,3,7), (N,)."""
    return ((frames @ W.T) ** 2).sum((1, 2))
