"""Static force: actuation force and brake factor over the pads' friction coefficient.

Roberts et al. (2003), section "Introduction": C* = 2 mu_B / (tan(alpha) - mu_B), positive while
the actuator pushes, negative while it pulls. That holds without friction; with it, the force at
rest may lie anywhere in a band, whose edges a slowly rising and a slowly falling moment show.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.wedge.case import case_from_parked, parameters_of
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.panels import COMPARED
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.series import FRICTIONLESS, Coefficients, tag, with_friction
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array

FREE, DRY = "frictionless", "friction"
_SHARE = 0.2  # of the moment: how far the ramps go to either side
_NO_FORCE = 1.0  # actuation force [N] below which the brake factor says nothing

_EACH = {
    "F_M": "N",
    "F_M_closed": "N",
    "F_M_rising": "N",
    "F_M_falling": "N",
    "C_star": "1",
    "C_star_closed": "1",
    "C_star_rising": "1",
    "C_star_falling": "1",
}
_ALL = {
    "F_M_error": "N",
    "C_star_error": "%",
    "neutral_mu": "1",
    "neutral_mu_closed": "1",
    "neutral_mu_rising": "1",
    "neutral_mu_falling": "1",
}


class Options(ParameterSet):
    """A moment, approached slowly from below and from above, then held."""

    M_hold: SomeMoment
    """moment at which the force is taken"""
    mu_B: Coefficients
    """friction coefficients of the pads"""
    t_start: Duration
    """time from the first demand to the rising ramp"""
    t_ramp: Duration
    """length of the rising ramp, and of the falling one; 20 % to either side of the moment"""
    t_hold: Duration
    """time at the moment, at the end"""


def demand(t: Array, options: Options) -> Array:
    """Return the moment demand [N m] at times t [s], shape (len(t),)."""
    T, low, high = options.t_ramp, 1.0 - _SHARE, 1.0 + _SHARE
    times = options.t_start + np.array([0.0, T, 2.0 * T, 2.5 * T])
    course = np.interp(t, times, [low, high, low, 1.0])
    return options.M_hold * np.where(t < -1e-9, 0.0, course)


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return two runs for each friction coefficient, on a true disc driven at constant speed."""
    stand = {"flywheel.law": "driven", "flywheel.runout": 0.0}
    duration = options.t_start + 2.5 * options.t_ramp + options.t_hold
    return tuple(
        case_from_parked(
            par, lambda t: {"M_set": demand(t, options)}, duration,
            stand | with_friction(par, mu_B, known=True) | changes,
            label=f"{kind}-{tag(mu_B)}",
        )
        for kind, changes in ((FREE, FRICTIONLESS), (DRY, {}))
        for mu_B in options.mu_B
    )  # fmt: skip


def _sign(run: xr.Dataset) -> float:
    """Return the side of the wedge: forces count toward clamping."""
    return -1.0 if float(run["x"].values[-1]) < 0 else 1.0


def _held(run: xr.Dataset) -> tuple[float, float]:
    """Return actuation and normal force [N] at the end."""
    return _sign(run) * float(run["F_M"].values[-1]), float(run["F_N"].values[-1])


def _slope(run: xr.Dataset, begin: float, end: float) -> float:
    """Return the mean actuation force over the mean normal force between two times [s]."""
    part = run.sel(time=slice(begin, end))
    pressed = float(part["F_N"].mean())
    return _sign(run) * float(part["F_M"].mean()) / pressed if pressed > 0 else math.nan


def _one(recordings: Recordings, mu_B: float, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of one friction coefficient."""
    free, dry = (recordings[f"{kind}-{tag(mu_B)}"] for kind in (FREE, DRY))
    F_M, F_N = _held(free)
    tan_alpha = wedge.slope(parameters_of(free).wedge)
    closed = (tan_alpha - mu_B) * F_N if F_N > 0 else math.nan
    T = options.t_ramp
    middle = options.t_start + 0.5 * T
    # The middle half of each ramp: 10 % to either side of the moment.
    rising, falling = (
        F_N * _slope(dry, at - 0.25 * T, at + 0.25 * T) for at in (middle, middle + T)
    )
    at, note = f"_{tag(mu_B)}", "" if F_N > 0 else "the pads do not press at the end"
    bad = "" if math.isfinite(rising + falling) else "the pads do not press on the ramps"
    factor = {
        name: _factor(name + at, text, mu_B * F_N, F, note or extra)
        for name, text, F, extra in (
            ("C_star", "Brake factor without friction, 2 mu_B F_N / F_M.", F_M, ""),
            ("C_star_closed", "Closed form of it, 2 mu_B / (tan(alpha) - mu_B).", closed, ""),
            ("C_star_rising", "With friction: brake factor while the moment rises.", rising, bad),
            ("C_star_falling", "With friction: brake factor while it falls.", falling, bad),
        )
    }
    return (
        Kpi("F_M" + at, F_M, "N", "Actuation force at the end, without friction.", note),
        Kpi("F_M_closed" + at, closed, "N",
            "Closed form of it, (tan(alpha) - mu_B) F_N, at that normal force.", note),
        Kpi("F_M_rising" + at, rising, "N",
            "With friction: mean force while the moment rises slowly, at that normal force.", bad),
        Kpi("F_M_falling" + at, falling, "N",
            "The same while it falls slowly: the force at rest is anywhere between.", bad),
        *factor.values(),
    )  # fmt: skip


def _factor(name: str, text: str, F_B: float, F_M: float, problem: str) -> Kpi:
    """Return a brake factor: both pads' braking force over the actuation force."""
    vague = f"the actuation force is below {_NO_FORCE:g} N: the brake factor is not bounded"
    note = problem or ("" if abs(F_M) >= _NO_FORCE else vague)
    return Kpi(name, math.nan if note else 2.0 * F_B / F_M, "1", text, note)


def _neutral(name: str, text: str, options: Options, forces: Array) -> Kpi:
    """Return the friction coefficient at which a force changes its sign, by straight lines."""
    order = np.argsort(options.mu_B)
    mu, F = np.array(options.mu_B)[order], forces[order]
    crossings = np.flatnonzero((F[:-1] > 0) & (F[1:] <= 0))
    if not crossings.size:
        note = "the actuation force does not change its sign in this range"
        return Kpi(name, math.nan, "1", text, note)
    k = int(crossings[0])
    value = mu[k] + (mu[k + 1] - mu[k]) * F[k] / (F[k] - F[k + 1])
    return Kpi(name, float(value), "1", text)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return forces and brake factors for every friction coefficient, and how they agree."""
    each = [_one(recordings, mu_B, options) for mu_B in options.mu_B]
    column = {name: [kpis[k].value for kpis in each] for k, name in enumerate(_EACH)}
    wrong = [
        abs(found - closed)
        for found, closed in zip(column["F_M"], column["F_M_closed"], strict=True)
        if math.isfinite(closed)
    ]
    shares = [
        abs(found / closed - 1.0)
        for found, closed in zip(column["C_star"], column["C_star_closed"], strict=True)
        if math.isfinite(found * closed)
    ]
    tan_alpha = wedge.slope(parameters_of(next(iter(recordings.values()))).wedge)
    # Forces times mu_B are forces per normal force at equal moments: straight lines over mu_B.
    neutral = {
        "neutral_mu": ("F_M", "Coefficient at which no actuation force is needed, no friction."),
        "neutral_mu_rising": ("F_M_rising", "The same with friction, while the moment rises."),
        "neutral_mu_falling": ("F_M_falling", "The same with friction, while the moment falls."),
    }
    found = {
        name: _neutral(name, text, options, np.multiply(column[F], options.mu_B))
        for name, (F, text) in neutral.items()
    }
    closed = Kpi("neutral_mu_closed", tan_alpha, "1", "Closed form of it, tan(alpha).")
    return (
        *(kpi for kpis in each for kpi in kpis),
        Kpi("F_M_error", max(wrong, default=math.nan), "N",
            "Largest difference of force and closed form, without friction.",
            "" if wrong else "the pads press at no coefficient"),
        Kpi("C_star_error", 100.0 * max(shares, default=math.nan), "%",
            "Largest difference of brake factor and closed form, without friction.",
            "" if shares else "no brake factor is bounded"),
        found["neutral_mu"], closed, found["neutral_mu_rising"], found["neutral_mu_falling"],
    )  # fmt: skip


def named(options: Options) -> dict[str, str]:
    """Return the unit of every key figure."""
    each = {f"{name}_{tag(mu_B)}": unit for mu_B in options.mu_B for name, unit in _EACH.items()}
    return each | _ALL


_DEFAULTS = Options(
    M_hold=500.0,
    mu_B=(0.2, 0.3, 0.35, 0.4, 0.5, 0.6),
    t_start=0.4,
    t_ramp=0.6,
    t_hold=0.5,
)

EXPERIMENT = Experiment(
    name="static-force",
    assembly="wedge-brake",
    summary="actuation force and brake factor C* over pad friction, with and without dry friction",
    options=Options,
    defaults=_DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=named(_DEFAULTS),
    figures=("brake-factor", "overlaid-traces"),
    compared=COMPARED,
    named=named,
)
