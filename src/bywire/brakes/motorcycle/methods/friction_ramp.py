"""Friction from a slow current ramp up and down (2010, eqs. 16 and 17, Fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.experiments import friction_ramp
from bywire.brakes.motorcycle.methods.stick_slip.curves import replayed, stribeck_band
from bywire.brakes.motorcycle.methods.stick_slip.loss import Noise, SlipLoss
from bywire.brakes.motorcycle.methods.stick_slip.shooting import Shooting
from bywire.brakes.motorcycle.methods.stick_slip.shots import (
    Shot,
    cut_out,
    require_calm,
    require_reachable,
)
from bywire.brakes.motorcycle.methods.stick_slip.slips import find_slips
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Pressure, Unit
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.measured import wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.multistart import Search, nearer, search
from bywire.identification.noise import noise_of
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown, parameters_of, scattered
from bywire.simulation.run import simulate

_NAMES = ("T_pr", "f_cfr_p", "f_cfr_n", "k_brk_p", "k_brk_n", "c", "mu_T")
_ZERO, _RIPPLE = "offset.i", "offset.i_ripple"
# The search of several starts, coarse in time: first the beginnings of slips, which have few minima
# once that is held which they hardly tell. The best minimum is then fitted in full.
_QUICK_STEP, _BEGINNING, _QUICK_LENGTH = 1e-4, 0.6, 4.0  # s
_HARDLY_TOLD = ("seal.c", "seal.mu_T")
_LIMIT_REPLAY, _LIMIT_RESIDUAL, _LIMIT_ZERO, _LIMIT_RIPPLE = 0.1, 1.1, 5.0, 3.0


class Options(ParameterSet):
    """What counts as a slip, and how sure measurements are."""

    least: Pressure
    """changes of pressure smaller than this are no slips"""
    longest: Duration
    """how much of a slip is compared"""
    scatter: Current
    """standard deviation of the current that breaks the piston away, from slip to slip, beside the
    noise of its measurement and its ripple"""
    zero: Current
    """standard deviation of the zero of the current's sensor, which all slips share"""
    ripple: Current
    """standard deviation of by how much more than its mean the current is where the piston breaks
    away: it does so at a peak of the current's ripple"""
    sigma_p: Annotated[float, Unit("Pa", 2e3), Field(ge=0)]
    """noise of the pressure in synthetic measurements"""
    sigma_i: Annotated[float, Unit("A", 1e-2), Field(ge=0)]
    """noise of the current's sensors in synthetic measurements: of the one that is recorded, and
    of the one that the control acts on"""
    step: Duration
    """substep of the slips' runs"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Return the friction's parameters, T_pr among them.

    Parameters
    ----------
    data
        ``i``: measured motor current [A]; ``p_mc``: pressure [Pa]. The demand in place of the
        current biases the estimates: while the shaft turns quickly the current lags behind it.
    par
        What is known. Motor and current controller count: with them the current dips, as a slip
        begins, that breaks away from the ramp; dither is off.

    Raises
    ------
    ParameterError
        When the record has no slip to learn from, or a pressure that the brake cannot have.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 4.1; the loss is ours, see
    ``bywire.brakes.motorcycle.methods.stick_slip.loss``.
    """
    shots = shots_of(data, options)
    require_reachable(shots, par)
    require_calm(shots, noise_of(data["i"].values), _LIMIT_RIPPLE * options.ripple)
    led, best = _fitted(data, par, options, effort)
    values = best.parameters()
    identified_par = par.replace(values)
    zero = best[_ZERO] if _ZERO in best.names else 0.0
    whole = replayed(data.assign(i=data["i"] - zero), identified_par, options.step)
    error = whole["modeled"] - whole["measured"]
    nrmse = float(np.sqrt((error**2).mean()) / np.ptp(data["p_mc"].values))
    return Identified(
        estimates={"seal friction": best},
        parameters=values,
        checks=(
            Check(
                "residual_over_noise",
                best.rms,
                limit=_LIMIT_RESIDUAL,
                note="aligned slips: residual over the sensor's noise",
            ),
            Check(
                "replay_nrmse",
                nrmse,
                limit=_LIMIT_REPLAY,
                note="whole ramp, computed less measured, over the range",
            ),
            Check(
                "zero_over_usual",
                abs(zero) / options.zero,
                limit=_LIMIT_ZERO,
                note="reading of the current's sensor without current, over its usual size: more "
                "may also be the zero of the pressure's sensor, a unit, or the torque constant",
            ),
            Check("starts_at_minimum", led.reached / effort.starts),
        ),
        curves=(
            Curve(
                "ramp",
                "Pressure on the ramp: measured, and modeled with the estimates.",
                whole,
                "time",
            ),
            _stribeck(identified_par, best),
        ),
        notes=(
            _counted(shots),
            f"{led.reached} of {effort.starts} starts reached the minimum",
        ),
    )


def _fitted(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> tuple[Search, Estimate]:
    """Return where the starts led, and the best minimum fitted in full."""
    known = {_ZERO: options.zero, _RIPPLE: options.ripple}
    unknowns = (
        *parameters_of(par, [f"seal.{name}" for name in _NAMES]),
        *(Unknown(k, 0.0, scale=v, unit="A", prior=(0.0, v)) for k, v in known.items()),
    )
    beginning, longer = (
        _problem(data, par, _quick(options, length), unknowns)
        for length in (_BEGINNING, _QUICK_LENGTH)
    )
    led = search(
        longer,
        scattered(unknowns, effort.starts, effort.spread, effort.seed),
        "linear",
        effort.progress,
        effort.store,
        effort.threads,
        partial(nearer, beginning, _HARDLY_TOLD),
    )
    at = led.best.values
    best = estimate(_problem(data, par, options, unknowns, at), start=at)
    if not any(name.startswith("seal.") for name in best.names):
        raise ParameterError(
            "the slips tell nothing of the seal's friction with this current: check the units of "
            "i and p_mc, and motor.K_e, gear and cylinder, which are taken as known"
        )
    return led, best


def _quick(options: Options, length: float) -> Options:
    return options.replace(
        {"step": max(_QUICK_STEP, options.step), "longest": min(length, options.longest)}
    )


def _problem(
    data: xr.Dataset,
    par: MotorcycleParameters,
    options: Options,
    unknowns: tuple[Unknown, ...],
    weighted_at: Array | None = None,
) -> Problem:
    shots = shots_of(data, options)
    noise = Noise(
        max(noise_of(data["p_mc"].values), 1.0), noise_of(data["i"].values), options.scatter
    )
    loss, finer = (
        SlipLoss(Shooting(par, unknowns[: len(_NAMES)], step), shots, noise, weighted_at)
        for step in (options.step, 0.5 * options.step)
    )
    is_final = weighted_at is not None
    return Problem(
        unknowns, loss, apart=len(shots), instrument=is_final, finer=finer if is_final else None
    )


def shots_of(data: xr.Dataset, options: Options) -> list[Shot]:
    """Return the measured slips.

    Raises
    ------
    ParameterError
        When there is none, or the pressure falls where the current rises.
    """
    t, p, i = (data[name].values for name in ("time", "p_mc", "i"))
    together = float(np.mean((p - p.mean()) * (i - i.mean())) / max(p.std() * i.std(), 1e-300))
    if together < 0.0:
        raise wrong_sign("p_mc", "i", f"correlation {together:.2f}")
    slips = find_slips(p, even_interval(t), options.least)
    if not slips:
        raise ParameterError(
            f"the pressure shows no slip of more than {options.least / 1e5:g} bar: friction cannot "
            "be learned from it; ramp the current slowly, up and down, without dither"
        )
    return cut_out(t, p, i, slips, options.longest)


def _counted(shots: Sequence[Shot]) -> str:
    up = sum(shot.slip.direction > 0 for shot in shots)
    return f"slips: {up} up, {len(shots) - up} down"


def _stribeck(par: MotorcycleParameters, fit: Estimate) -> Curve:
    return Curve(
        "stribeck",
        "Identified Stribeck curves with 95 % bands (Fig. 4).",
        stribeck_band(par.seal, fit, (2e5, 20e5, 40e5), np.linspace(-2.0, 2.0, 201)),
        "omega",
    )


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the ramp of eq. (17) without dither, simulated, with the sensors' noise."""
    sensor = par.current_sensor
    share = options.sigma_i / (sensor.i_high - sensor.i_low)
    noisy_par = par.replace({"adc.noise": float(np.hypot(par.adc.noise, share))})
    case = friction_ramp.EXPERIMENT.cases(noisy_par, friction_ramp.EXPERIMENT.defaults, None)[0]
    computed = simulate(as_run(case, 20e-6, seed=(seed,)), ("i", "p_mc"))
    random = np.random.default_rng(seed)
    noise = random.normal(0.0, options.sigma_p, computed.time.size)
    noise_i = random.normal(random.normal(0.0, options.zero), options.sigma_i, computed.time.size)
    return xr.Dataset(
        {
            "i": ("time", computed["i"] + noise_i, {"units": "A"}),
            "p_mc": ("time", computed["p_mc"] + noise, {"units": "Pa"}),
        },
        {"time": ("time", computed.time, {"units": "s"})},
    )


METHOD = Method(
    name="friction-ramp",
    assembly="motorcycle-brake",
    summary="seal friction from the slow ramp: breakaway and slips (2010, eqs. 16, 17, Fig. 4)",
    experiment="friction-ramp",
    signals={"i": "A", "p_mc": "Pa"},
    options=Options,
    defaults=Options(
        least=0.2e5,
        longest=6.0,
        scatter=5e-4,
        zero=2e-3,
        ripple=1e-2,
        sigma_p=2e3,
        sigma_i=3e-3,
        step=20e-6,
    ),
    identify=identify,
    synthetic=synthetic,
    simulated=("sigma_p", "sigma_i"),
    unknowns=tuple(f"seal.{name}" for name in _NAMES),
    further={
        _ZERO: ("A", "reading of the current's sensor without current"),
        _RIPPLE: ("A", "by how much the current at its peaks exceeds its mean"),
    },
)
