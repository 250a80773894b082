"""Robust losses: honest intervals with and without outliers, derivatives, and priors left alone."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Loss, Problem, estimate, influence, rho
from bywire.identification.unknown import Unknown


def line(seed: int, share: float, loss: Loss) -> Estimate:
    """Return the fit of a straight line, a share of whose measurements are outliers."""
    random = np.random.default_rng(seed)
    X = np.column_stack((np.ones(60), np.linspace(-1.0, 1.0, 60)))
    e = random.normal(size=60)
    spoiled = random.random(60) < share
    e[spoiled] += random.normal(0.0, 20.0, int(spoiled.sum()))
    y = X @ [1.0, 2.0] + e
    unknowns = (Unknown("a", 1.0, scale=9.0), Unknown("b", 2.0, scale=9.0))
    return estimate(Problem(unknowns, lambda v: (X @ v - y, X)), loss)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy"])
@pytest.mark.parametrize("share", [0.0, 0.05])
def test_intervals_of_every_loss_are_honest(loss: Loss, share: float) -> None:
    """An M-estimate's covariance has the mean slope of its influence, not its weight."""
    found = [line(seed, share, loss) for seed in range(60)]
    inside = np.mean(
        [(f.intervals()[:, 0] < [1, 2]) & (f.intervals()[:, 1] > [1, 2]) for f in found]
    )
    assert 0.9 <= inside <= 0.99
    scatter = np.std([f.values for f in found], axis=0)
    claimed = np.mean([f.deviations for f in found], axis=0)
    np.testing.assert_allclose(claimed / scatter, 1.0, atol=0.25)


@pytest.mark.parametrize("loss", ["soft_l1", "huber", "cauchy"])
def test_a_loss_agrees_with_its_derivatives(loss: Loss) -> None:
    z, h = np.array([0.1, 0.7, 1.5, 9.0, 400.0]), 1e-5
    _, first, second = rho(z, loss)
    up, down = rho(z + h, loss), rho(z - h, loss)
    np.testing.assert_allclose((up[0] - down[0]) / (2 * h), first, rtol=1e-5)
    np.testing.assert_allclose((up[1] - down[1]) / (2 * h), second, rtol=1e-4, atol=1e-10)
    psi, slope = influence(np.sqrt(z), loss)
    change = influence(np.sqrt(z) + h, loss)[0] - influence(np.sqrt(z) - h, loss)[0]
    np.testing.assert_allclose(change / (2 * h), slope, rtol=1e-4, atol=1e-10)
    np.testing.assert_allclose(psi, np.sqrt(z) * first)


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_leaves_priors_alone(loss: Loss) -> None:
    """One measurement of 2 with unit noise against a prior of 9: the loss counts only the first."""
    unknown = Unknown("x", 2.0, prior=(9.0, 0.01))
    problem = Problem((unknown,), lambda v: (np.full(3, v[0] - 2.0), np.ones((3, 1))))
    found = estimate(problem, loss)
    assert found["x"] == pytest.approx(9.0, abs=1e-3)
    assert not found.notes
