"""Eq. (22) fitted to the records of one pressure region, in the paper's two steps or at once."""

from __future__ import annotations

import math

import numpy as np

from bywire.brakes.motorcycle.linear.brake import two_pole
from bywire.brakes.motorcycle.methods.braking.records import BAND, Region
from bywire.brakes.motorcycle.methods.braking.slow_pair import (
    NAMES,
    impulse,
    log_response,
    response,
)
from bywire.brakes.motorcycle.methods.braking.two_step import in_turn, restricted
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.unknown import Unknown

_DECADE = 10.0  # tau_L and T_L begin one decade below T1
_FAR = 1e3  # how far from its start a time constant may go
_UNITS = {"K": "Pa/A"}
_WEIGHED = 2  # fits: the noise is weighed by the model that is started from, then by the one found
_MOVES = 5.0  # of a block's noise: what a step must change the pressure by


class Whitening:
    r"""Makes residuals of block means independent, of size one.

    .. math::
        \Sigma = \sigma^2 I + \sigma_u^2 (H - H 1 w^T)(H - H 1 w^T)^T

    with H the response of the means to every sample of the input, and w the mean before the step,
    which is taken off the input: a model run over a measured current answers to its noise too,
    slowly, as the brake does, so that neighboring residuals go together over seconds.

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L of the model that answers; SI, shape (5,).
    blocks, block
        Number of means, and samples in each.
    rest
        Samples before the step whose mean is taken off.
    sigma, sigma_u
        Noise of a mean of the output, and of a sample of the input.
    interval
        Sample time [s].
    """

    def __init__(
        self,
        values: Array,
        blocks: int,
        block: int,
        rest: int,
        sigma: float,
        sigma_u: float,
        interval: float,
    ) -> None:
        n = blocks * block
        h = impulse(values, n, interval)
        means = np.convolve(h, np.ones(block) / block)[:n]
        # Row k: the mean over the block that ends with sample (k + 1) block - 1.
        last = (np.arange(blocks) + 1) * block - 1
        back = last[:, None] - np.arange(n)[None, :]
        H = np.where(back >= 0, means[np.clip(back, 0, n - 1)], 0.0)
        H[:, :rest] -= H.sum(axis=1)[:, None] / rest
        covariance = sigma_u**2 * (H @ H.T)
        covariance[np.diag_indices(blocks)] += sigma**2
        self._root = np.linalg.cholesky(covariance)

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (blocks,) or (blocks, p), made independent."""
        from scipy import linalg

        return np.asarray(linalg.solve_triangular(self._root, values, lower=True))


def starts_of(par: MotorcycleParameters, p: float) -> dict[str, float]:
    """Return where the fit begins, as in the paper: eq. (15), and the pair one decade below.

    ``p``: pressure [Pa].

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 5.
    """
    model = two_pole(par, p, travel_at(p, par))
    slow, fast = (1.0 / (2.0 * math.pi * f) for f in model.poles_hz)
    pair = _DECADE * slow
    return {"K": model.gain, "tau_L": pair, "T1": slow, "T2": fast, "T_L": pair}


def unknowns_of(region: Region, starts: dict[str, float]) -> tuple[Unknown, ...]:
    """Return the five of eq. (22), and the pressure at rest before every step."""
    five = [
        Unknown(
            name,
            starts[name],
            starts[name] / _FAR,
            starts[name] * _FAR,
            starts[name],
            _UNITS.get(name, "s"),
            trial=region.name,
        )
        for name in NAMES
    ]
    rests = [
        Unknown(
            "p_rest",
            step.rest,
            scale=max(abs(step.rest), 1e4),
            unit="Pa",
            trial=step.label or "step",
        )
        for step in region.steps
    ]
    return (*five, *rests)


def over_time(region: Region, unknowns: tuple[Unknown, ...], near: Array) -> Problem:
    """Return the fit to the step responses, every block of time one residual.

    ``near``: k, tau_L, T1, T2, T_L by which the noise of the measured current is weighed, shape
    (5,).
    """
    whitenings = [
        Whitening(
            near,
            step.pressure.size,
            step.block,
            step.before,
            step.sigma,
            step.sigma_i,
            step.interval,
        )
        for step in region.steps
    ]

    def evaluate(values: Array) -> tuple[Array, Array]:
        residuals, jacobians = [], []
        for k, (step, white) in enumerate(zip(region.steps, whitenings, strict=True)):
            y, slopes = response(values[:5], step.u, step.interval, step.block)
            J = np.zeros((y.size, values.size))
            J[:, :5], J[:, 5 + k] = slopes, 1.0
            residuals.append(white(values[5 + k] + y - step.pressure))
            jacobians.append(white(J))
        return np.concatenate(residuals), np.vstack(jacobians)

    return Problem(unknowns, evaluate)


def over_frequency(region: Region, unknowns: tuple[Unknown, ...]) -> Problem:
    """Return the fit to magnitude (logarithm) and phase [rad] of the frequency response."""
    points = region.points

    def evaluate(values: Array) -> tuple[Array, Array]:
        G, slopes = log_response(values[:5], points.frequencies)
        e = G - points.log_gain
        turned = (e.imag + math.pi) % (2.0 * math.pi) - math.pi
        J = np.zeros((2 * e.size, values.size))
        J[0::2, :5], J[1::2, :5] = slopes.real, slopes.imag
        weight = np.repeat(1.0 / points.deviation, 2)
        return np.column_stack((e.real, turned)).ravel() * weight, J * weight[:, None]

    return Problem(unknowns, evaluate)


def fit(
    region: Region, par: MotorcycleParameters, *, joint: bool, turns: int, pair: bool = True
) -> Estimate:
    """Return K, tau_L, T1, T2, T_L of a region.

    Parameters
    ----------
    region
        Its records.
    par
        Where the search begins, see ``starts_of``.
    joint
        All unknowns by all data; else K, tau_L and T_L by the steps, T1 and T2 by the sines.
    turns
        How often the two steps are taken at most; the paper takes them once.
    pair
        Whether there is a slow pair: eq. (22); else tau_L = T_L, eq. (21).

    Raises
    ------
    ParameterError
        When the records cannot tell the unknowns, with the experiment that would.
    """
    _require(region, joint)
    starts = starts_of(par, region.pressure)
    near = np.array(list(starts.values()))
    unknowns = unknowns_of(region, starts)
    for _ in range(_WEIGHED):
        best = _fitted(region, unknowns, near, turns=0 if joint else turns, pair=pair)
        near = np.array(list(five_of(best).values()))
    return best


def _fitted(
    region: Region, unknowns: tuple[Unknown, ...], near: Array, *, turns: int, pair: bool
) -> Estimate:
    """Return the estimate, in turns of two steps or, without turns, by all data at once."""
    time, frequency = over_time(region, unknowns, near), over_frequency(region, unknowns)
    rests = range(len(NAMES), len(unknowns))
    by_steps = [0, *((1, 4) if pair else ()), *rests]
    if turns:
        return in_turn((time, frequency), (by_steps, [2, 3]), turns)

    def evaluate(values: Array) -> tuple[Array, Array]:
        parts = [problem.evaluate(values) for problem in (time, frequency)]
        return np.concatenate([r for r, _ in parts]), np.vstack([J for _, J in parts])

    starts = np.array([u.start for u in unknowns])
    return estimate(restricted(Problem(unknowns, evaluate), sorted([*by_steps, 2, 3]), starts))


def five_of(fitted: Estimate) -> dict[str, float]:
    """Return K, tau_L, T1, T2 and T_L of an estimate, those that were kept included."""
    values = {u.name: float(v) for u, v in zip(fitted.unknowns, fitted.values, strict=True)}
    values |= {k.unknown.name: k.unknown.start for k in fitted.kept}
    if "T_L" not in values and "tau_L" not in values:  # eq. (21): any pair that cancels
        values["tau_L"] = values["T_L"] = 1.0
    return {name: values[name] for name in NAMES}


def _require(region: Region, joint: bool) -> None:
    where = f"{region.name} pressure"
    if not region.steps:
        raise ParameterError(
            f"there is no step response at {where}: K, tau_L and T_L cannot be estimated; step "
            "the current demand from rest there, and record 4 s or more"
        )
    for step in region.steps:
        change = float(np.ptp(step.pressure))
        if not change > _MOVES * step.sigma or float(np.ptp(step.u)) == 0.0:
            raise ParameterError(
                f"the pressure hardly answers the step at {where} (it moves by {change / 1e5:.2g} "
                f"bar, its noise is {step.sigma / 1e5:.2g} bar): none of {', '.join(NAMES)} can be "
                "estimated; take a larger step, with dither"
            )
    count = region.points.frequencies.size
    if not joint and count < 2:
        raise ParameterError(
            f"{count or 'no'} sine{'s' if count != 1 else ''} within {BAND[0]:g} and {BAND[1]:g} "
            f"Hz at {where}: T1 and T2 cannot be estimated from the frequency response; shake the "
            "current demand at two frequencies or more, or set fit = 'joint'"
        )
