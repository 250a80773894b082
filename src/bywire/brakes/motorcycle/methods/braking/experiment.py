"""The experiment of section 5 of Dardanelli et al. (2010), simulated: steps and sines by region."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, as_run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.linear.brake import two_pole, with_slow_pair
from bywire.brakes.motorcycle.linear.rational import Rational
from bywire.brakes.motorcycle.operating_point import settled_start
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, travel_at
from bywire.control.dither import breakaway_current
from bywire.core.interrupts import thread_pool
from bywire.core.typing import Array
from bywire.data.labeled import labeled
from bywire.simulation.run import Run, simulate

Demand = Callable[[Array], Array]

REST, STEP, SINES = 1.0, 4.0, 4.0
"""time before a step, after it, and of every record of a sine [s]"""
_SETTLE, _SETTLE_SINE = 3.0, 2.0
_INTERVAL = 1e-3


def demands(
    i_step: float, amplitude: float, frequencies: tuple[float, ...]
) -> dict[str, tuple[Demand, float, float]]:
    """Return changes of the current demand [A] by record, with the times before and after zero."""
    chosen: dict[str, tuple[Demand, float, float]] = {"step": (partial(_step, i_step), REST, STEP)}
    for f in frequencies:
        chosen[f"{f:g}_Hz"] = (partial(_sine, amplitude, f), 0.0, SINES)
    return chosen


def _step(height: float, t: Array) -> Array:
    return np.where(t < -1e-9, 0.0, height)


def _sine(amplitude: float, f: float, t: Array) -> Array:
    return np.asarray(amplitude * np.sin(2.0 * math.pi * f * t))


def of_brake(
    par: MotorcycleParameters,
    pressures: Mapping[str, float],
    changes: Mapping[str, tuple[Demand, float, float]],
    sigma_p: float,
    sigma_i: float,
    seed: int,
) -> dict[str, xr.Dataset]:
    """Return measured current and pressure of the whole brake, friction and dither included.

    Both go through the same filter and converter, whose lag therefore cancels between them.

    Parameters
    ----------
    pressures
        Mean pressure [Pa] by region.
    changes
        What ``demands`` gives.
    sigma_p, sigma_i
        Noise ahead of the converter [Pa], [A]: that of the pressure is drawn into the loop, so
        that the dither, whose amplitude follows the measured pressure, feels it.
    seed
        Of the noise.
    """
    span = par.pressure_sensor.p_high - par.pressure_sensor.p_low
    reach = par.current_sensor.i_high - par.current_sensor.i_low
    share_p, share_i = sigma_p / span, sigma_i / reach
    noisy_par = par.replace({"adc.noise": 1.0})  # the stimulus' noise is scaled, each channel apart
    jobs: list[tuple[str, Case, int]] = []
    for region, p in pressures.items():
        start = settled_start(p, par, _SETTLE)
        hold = holding_current(start, par)
        for name, (change, before, after) in changes.items():
            case = _case(noisy_par, start, hold, change, before, after)
            jobs.append((f"{region}_{name}", case, len(jobs)))

    def computed(job: tuple[str, Case, int]) -> tuple[str, xr.Dataset]:
        label, case, number = job
        run = as_run(case, 20e-6, seed=(seed, number))
        scaled = _scaled(run, {"noise_p": share_p, "noise_i": share_i})
        read = simulate(replace(run, stimulus=scaled), ("i_meas", "p_meas"))
        keep = read.time >= case.settle - case.keep - 1e-9
        return label, _dataset(read["i_meas"][keep], read["p_meas"][keep])

    with thread_pool() as pool:
        return dict(pool.map(computed, jobs))


def _case(
    par: MotorcycleParameters,
    start: float,
    hold: float,
    change: Demand,
    before: float,
    after: float,
) -> Case:
    settle = _SETTLE + before if before else _SETTLE_SINE
    return case_from_rest(
        "run",
        par,
        "current",
        start,
        lambda t: {"i_set": hold + change(t)},
        after,
        settle=settle,
        keep=before,
    )


def _scaled(run: Run, shares: Mapping[str, float]) -> Demand:
    """Return the stimulus with each channel's noise at its own share of the span."""
    columns = {run.model.Stimulus._fields.index(name): share for name, share in shares.items()}

    def rows(t: Array) -> Array:
        stimulus = run.stimulus(t)
        for column, share in columns.items():
            stimulus[:, column] *= share
        return stimulus

    return rows


def of_eq22(
    models: Mapping[str, tuple[float, Rational]],
    par: MotorcycleParameters,
    changes: Mapping[str, tuple[Demand, float, float]],
    sigma_p: float,
    sigma_i: float,
    seed: int,
) -> dict[str, xr.Dataset]:
    """Return the same of a linear brake that is eq. (22) exactly, with dither on its current.

    ``models``: pressure at rest [Pa] and transfer function [Pa/A] by region.
    """
    from scipy import signal

    random = np.random.default_rng(seed)
    signals = {}
    for region, (p, model) in models.items():
        amplitude = breakaway_current(p, par.ecu.est_par) * par.ecu.dither.gain
        for name, (change, before, after) in changes.items():
            lead = before + _SETTLE + _SETTLE_SINE
            ticks = np.arange(-round(lead / _INTERVAL), round(after / _INTERVAL) + 1)
            t = np.asarray(ticks * _INTERVAL, dtype=float)
            shake = amplitude * np.sin(2.0 * math.pi * par.ecu.dither.f_dit * t)
            u = change(t) + (shake if par.ecu.dither.waveform != "off" else 0.0)
            num, den = sampled(model, _INTERVAL)
            y = signal.lfilter(num, den, u)
            i = holding_current(p, par) + u + random.normal(0.0, sigma_i, t.size)
            pressure = p + np.asarray(y) + random.normal(0.0, sigma_p, t.size)
            keep = t >= -before - 1e-9
            signals[f"{region}_{name}"] = _dataset(i[keep], pressure[keep])
    return signals


def sampled(model: Rational, interval: float) -> tuple[Array, Array]:
    """Return numerator and denominator for samples between which the input runs straight."""
    from scipy import signal

    num, den, _ = signal.cont2discrete((np.array(model.num), np.array(model.den)), interval, "foh")
    return np.ravel(num), np.asarray(den)


def eq22_of(par: MotorcycleParameters, p: float, f_zero: float, f_pole: float) -> Rational:
    """Return eq. (15)'s two slow poles at a pressure [Pa] with a slow pair [Hz] of its own."""
    model = two_pole(par, p, travel_at(p, par))
    slow, fast = model.poles_hz
    T = [1.0 / (2.0 * math.pi * f) for f in (f_zero, slow, fast, f_pole)]
    return with_slow_pair(model.gain, *T)


def _dataset(i: Array, p: Array) -> xr.Dataset:
    time = np.round(np.arange(i.size) * _INTERVAL, 9)
    signals = {"i": (i, "A", "measured current"), "p_mc": (p, "Pa", "measured pressure")}
    return labeled({"time": (time, "s", "time")}, signals)
