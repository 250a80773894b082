"""Static force: actuation force and brake factor versus pad friction coefficient.

Roberts et al. (2003), section "Introduction": C* = 2 mu_B / (tan(alpha) - mu_B), positive while
the actuator pushes, negative while it pulls. The formula neglects friction. With friction, the
force at rest may have any value in a band. A slowly rising and a slowly falling moment show the
limits of the band.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    FRICTIONLESS,
    Coefficients,
    case_from_parked,
    parameters_of,
    tag,
    with_friction,
)
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.panels import COMPARED
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

FREE, DRY = "frictionless", "friction"
_SHARE = 0.2  # half width of the ramps, relative to the moment
_NO_FORCE = 1.0  # actuation force [N] below which the brake factor is meaningless

EACH = Figures(
    F_M=("N", "Actuation force at the end, without friction."),
    F_M_closed=("N", "Closed form of F_M, (tan(alpha) - mu_B) F_N, at the same normal force."),
    F_M_rising=(
        "N",
        "With friction: mean force while the moment rises slowly, at the same normal force.",
    ),
    F_M_falling=(
        "N",
        "With friction: mean force while the moment falls slowly. The force at rest is between "
        "F_M_rising and F_M_falling.",
    ),
    C_star=("1", "Brake factor without friction, 2 mu_B F_N / F_M."),
    C_star_closed=("1", "Closed form of C_star, 2 mu_B / (tan(alpha) - mu_B)."),
    C_star_rising=("1", "With friction: brake factor while the moment rises."),
    C_star_falling=("1", "With friction: brake factor while the moment falls."),
)
ALL = Figures(
    F_M_error=(
        "N",
        "Maximum difference between actuation force and closed form, without friction.",
    ),
    C_star_error=(
        "%",
        "Maximum difference between brake factor and closed form, without friction.",
    ),
    neutral_mu=("1", "Pad friction coefficient at which F_M is zero."),
    neutral_mu_closed=("1", "Closed form of neutral_mu, tan(alpha)."),
    neutral_mu_rising=("1", "Pad friction coefficient at which F_M_rising is zero."),
    neutral_mu_falling=("1", "Pad friction coefficient at which F_M_falling is zero."),
)


class Options(ParameterSet):
    """A moment that the brake approaches slowly from below and from above, then holds."""

    M_hold: SomeMoment
    """moment at which the force is evaluated"""
    mu_B: Coefficients
    """pad friction coefficients"""
    t_start: Duration
    """time from the first demand to the rising ramp"""
    t_ramp: Duration
    """length of each ramp, rising and falling, from 20 % below to 20 % above the moment"""
    t_hold: Duration
    """hold time at the end"""


def demand(t: Array, options: Options) -> Array:
    """Return the moment demand [N m] at times t [s], shape (len(t),)."""
    T, low, high = options.t_ramp, 1.0 - _SHARE, 1.0 + _SHARE
    times = options.t_start + np.array([0.0, T, 2.0 * T, 2.5 * T])
    course = np.interp(t, times, [low, high, low, 1.0])
    return options.M_hold * np.where(t < -1e-9, 0.0, course)


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return two runs for each friction coefficient, on a true disc driven at constant speed."""
    stand = {"flywheel.law": "driven", "flywheel.runout": 0.0}
    duration = options.t_start + 2.5 * options.t_ramp + options.t_hold
    return tuple(
        case_from_parked(
            par,
            lambda t: {"M_set": demand(t, options)},
            duration,
            stand | with_friction(par, mu_B, known=True) | changes,
            label=f"{kind}-{tag(mu_B)}",
        )
        for kind, changes in ((FREE, FRICTIONLESS), (DRY, {}))
        for mu_B in options.mu_B
    )


def _sign(run: xr.Dataset) -> float:
    """Return the side of the wedge. Forces are positive toward clamping."""
    return -1.0 if float(run["x"].values[-1]) < 0 else 1.0


def _held(run: xr.Dataset) -> tuple[float, float]:
    """Return actuation and normal force [N] at the end."""
    return _sign(run) * float(run["F_M"].values[-1]), float(run["F_N"].values[-1])


def _slope(run: xr.Dataset, begin: float, end: float) -> float:
    """Return the ratio of mean actuation force to mean normal force between two times [s]."""
    part = run.sel(time=slice(begin, end))
    pressed = float(part["F_N"].mean())
    return _sign(run) * float(part["F_M"].mean()) / pressed if pressed > 0 else math.nan


def _each(recordings: Recordings, mu_B: float, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of one friction coefficient."""
    free, dry = (recordings[f"{kind}-{tag(mu_B)}"] for kind in (FREE, DRY))
    F_M, F_N = _held(free)
    tan_alpha = wedge.slope(parameters_of(free).wedge)
    closed = (tan_alpha - mu_B) * F_N if F_N > 0 else math.nan
    T = options.t_ramp
    middle = options.t_start + 0.5 * T
    # Use the middle half of each ramp, 10 % to either side of the moment.
    rising, falling = (
        F_N * _slope(dry, at - 0.25 * T, at + 0.25 * T) for at in (middle, middle + T)
    )
    note = "" if F_N > 0 else "the pads are not applied at the end"
    bad = "" if math.isfinite(rising + falling) else "the pads are not applied on the ramps"
    F_B = mu_B * F_N
    return EACH(
        f"_{tag(mu_B)}",
        F_M=(F_M, note),
        F_M_closed=(closed, note),
        F_M_rising=(rising, bad),
        F_M_falling=(falling, bad),
        C_star=_factor(F_B, F_M, note),
        C_star_closed=_factor(F_B, closed, note),
        C_star_rising=_factor(F_B, rising, note or bad),
        C_star_falling=_factor(F_B, falling, note or bad),
    )


def _factor(F_B: float, F_M: float, problem: str) -> tuple[float, str]:
    """Return a brake factor: ratio of both pads' braking force to the actuation force."""
    vague = f"the actuation force is below {_NO_FORCE:g} N, so the brake factor is unbounded"
    note = problem or ("" if abs(F_M) >= _NO_FORCE else vague)
    return math.nan if note else 2.0 * F_B / F_M, note


def _neutral(options: Options, F_M: list[float]) -> tuple[float, str]:
    """Return the friction coefficient at which a force changes sign, by linear interpolation.

    At equal moments, force times mu_B is proportional to force per normal force, which is a
    straight line in mu_B.
    """
    order = np.argsort(options.mu_B)
    mu, F = np.array(options.mu_B)[order], np.multiply(F_M, options.mu_B)[order]
    crossings = np.flatnonzero((F[:-1] > 0) & (F[1:] <= 0))
    if not crossings.size:
        return math.nan, "the actuation force does not change sign in this range"
    k = int(crossings[0])
    return float(mu[k] + (mu[k + 1] - mu[k]) * F[k] / (F[k] - F[k + 1])), ""


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return forces and brake factors for every friction coefficient, and their deviations."""
    each = [_each(recordings, mu_B, options) for mu_B in options.mu_B]
    column = {name: [kpis[k].value for kpis in each] for k, name in enumerate(EACH.units)}
    wrong = [
        abs(force - closed)
        for force, closed in zip(column["F_M"], column["F_M_closed"], strict=True)
        if math.isfinite(closed)
    ]
    shares = [
        abs(factor / closed - 1.0)
        for factor, closed in zip(column["C_star"], column["C_star_closed"], strict=True)
        if math.isfinite(factor * closed)
    ]
    overall = ALL(
        F_M_error=max(wrong)
        if wrong
        else (math.nan, "the pads are not applied at any coefficient"),
        C_star_error=100.0 * max(shares)
        if shares
        else (math.nan, "every brake factor is unbounded"),
        neutral_mu=_neutral(options, column["F_M"]),
        neutral_mu_closed=wedge.slope(parameters_of(next(iter(recordings.values()))).wedge),
        neutral_mu_rising=_neutral(options, column["F_M_rising"]),
        neutral_mu_falling=_neutral(options, column["F_M_falling"]),
    )
    return (*(kpi for kpis in each for kpi in kpis), *overall)


def named(options: Options) -> dict[str, str]:
    """Return the unit of every key figure."""
    return EACH.ending(*(f"_{tag(mu_B)}" for mu_B in options.mu_B)) | ALL.units


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
    summary="actuation force and C* versus pad friction, with and without dry friction",
    options=Options,
    defaults=_DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=named(_DEFAULTS),
    figures=("brake-factor", "overlaid-traces"),
    compared=COMPARED,
    named=named,
)
