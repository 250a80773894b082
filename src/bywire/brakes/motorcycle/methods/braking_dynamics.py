"""Transfer function from current to pressure by region (2010, eq. 22, Table 4, Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench.experiment import Case, as_run
from bywire.brakes.motorcycle.case import case_from_rest, settled_start
from bywire.brakes.motorcycle.linear import Rational, theoretical, two_pole, with_slow_pair
from bywire.brakes.motorcycle.methods.region_fit import (
    NAMES,
    Region,
    StepRecord,
    fit,
    five_of,
    over_frequency,
    regions_of,
    response,
    unknowns_of,
)
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, travel_at
from bywire.control.dither import breakaway_current
from bywire.core.errors import ParameterError
from bywire.core.interrupts import thread_pool
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Frequency, Pressure, Unit
from bywire.core.typing import Array
from bywire.data.labeled import labeled, over
from bywire.identification.estimate import Estimate
from bywire.identification.measured import joined, split
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.simulation.run import Run, simulate

if TYPE_CHECKING:
    import xarray as xr

# Curves of the braking dynamics: measured, modeled and theoretical magnitude, phase and step.


def curves_of(
    regions: Sequence[Region], estimates: Mapping[str, Estimate], par: MotorcycleParameters
) -> tuple[Curve, ...]:
    """Return measured, identified and theoretical responses of every region.

    Parameters
    ----------
    regions
        The records.
    estimates
        By region.
    par
        Parameters for eq. (15).

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eqs. (15), (22), Fig. 6.
    """
    curves: list[Curve] = []
    for region in regions:
        estimate = estimates[region.name]
        if region.points.frequencies.size:
            curves += _bode(region, estimate, par)
        curves += [
            Curve(
                f"{region.name}-step" if len(region.steps) == 1 else f"{region.name}-step-{k + 1}",
                f"Response to a current step at {region.name} pressure, dither averaged out: "
                "measured, identified, and eq. (15).",
                _step_curve(step, estimate, par, region.pressure),
                "time",
            )
            for k, step in enumerate(region.steps)
        ]
    return tuple(curves)


def _bode(region: Region, estimate: Estimate, par: MotorcycleParameters) -> list[Curve]:
    f = region.points.frequencies
    measured = np.exp(region.points.log_gain)
    modeled = with_slow_pair(*five_of(estimate).values()).response(f)
    theory = theoretical(par, region.pressure, travel_at(region.pressure, par)).response(f)
    parts = {"measured": measured, "modeled": modeled, "theoretical": theory}
    caption = (
        f"Frequency response from current to pressure at {region.name} pressure: measured, "
        "identified, and from eq. (15)."
    )
    axis = ("frequency", f, "Hz", "frequency")
    magnitude, phase = (
        over(axis, {name: part(G) for name, G in parts.items()}, unit, label)
        for part, unit, label in ((np.abs, "Pa/A", "gain"), (_degrees, "degree", "phase"))
    )
    return [
        Curve(f"{region.name}-gain", caption, magnitude, "frequency"),
        Curve(f"{region.name}-phase", caption, phase, "frequency"),
    ]


def _degrees(G: NDArray[np.complex128]) -> Array:
    return np.degrees(np.unwrap(np.angle(G)))


def _step_curve(
    step: StepRecord, estimate: Estimate, par: MotorcycleParameters, p: float
) -> xr.Dataset:
    rest = estimate[f"{step.label or 'step'}:p_rest"]
    y, _ = response(np.array(list(five_of(estimate).values())), step.u, step.interval, step.block)
    middle = np.arange(y.size) * step.block + 0.5 * (step.block - 1)
    t = np.asarray((middle - step.before) * step.interval, dtype=float)
    height = float(np.mean(step.u[step.before :]))
    theory = rest + height * theoretical(par, p, travel_at(p, par)).step(t)
    columns = {"measured": step.pressure, "modeled": rest + y, "theoretical": theory}
    return over(("time", t, "s", "time after the step"), columns, "Pa", "pressure")


# The simulated experiment of Dardanelli et al. (2010), section 5: steps and sines in each region.

Demand = Callable[[Array], Array]

REST, STEP, SINES = 1.0, 4.0, 4.0
"""time before a step, after it, and length of every sine record [s]"""
_SETTLE, _SETTLE_SINE = 3.0, 2.0
_INTERVAL = 1e-3


def demands(
    i_step: float, amplitude: float, frequencies: tuple[float, ...]
) -> dict[str, tuple[Demand, float, float]]:
    """Return current demand changes [A] by record, with the times before and after t = 0."""
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
    """Return measured current and pressure of the whole brake, with friction and dither.

    Both signals pass through the same kind of filter and converter, so their lags cancel.

    Parameters
    ----------
    pressures
        Mean pressure [Pa] by region.
    changes
        Demand changes as returned by ``demands``.
    sigma_p, sigma_i
        Noise upstream of the converter [Pa], [A]. The pressure noise acts inside the loop, because
        the dither amplitude follows the measured pressure.
    seed
        Seed of the noise.
    """
    span = par.pressure_sensor.p_high - par.pressure_sensor.p_low
    reach = par.current_sensor.i_high - par.current_sensor.i_low
    share_p, share_i = sigma_p / span, sigma_i / reach
    noisy_par = par.replace({"adc.noise": 1.0})  # `_scaled` sets the noise of each channel
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
    """Return the stimulus with each channel's noise scaled to its fraction of the span."""
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
    """Return current and pressure of a linear brake that follows eq. (22), with dither current.

    ``models``: rest pressure [Pa] and transfer function [Pa/A] by region.
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
    """Return numerator and denominator for an input that is linear between samples."""
    from scipy import signal

    num, den, _ = signal.cont2discrete((np.array(model.num), np.array(model.den)), interval, "foh")
    return np.ravel(num), np.asarray(den)


def eq22_of(par: MotorcycleParameters, p: float, f_zero: float, f_pole: float) -> Rational:
    """Return a model with eq. (15)'s two slow poles at a pressure [Pa] and a slow pair [Hz]."""
    model = two_pole(par, p, travel_at(p, par))
    slow, fast = model.poles_hz
    T = [1.0 / (2.0 * math.pi * f) for f in (f_zero, slow, fast, f_pole)]
    return with_slow_pair(model.gain, *T)


def _dataset(i: Array, p: Array) -> xr.Dataset:
    time = np.round(np.arange(i.size) * _INTERVAL, 9)
    signals = {"i": (i, "A", "measured current"), "p_mc": (p, "Pa", "measured pressure")}
    return labeled({"time": (time, "s", "time")}, signals)


_MISFIT_STEP, _MISFIT_SINES = 0.05, 0.1


class Options(ParameterSet):
    """Pressure regions, the fit's two steps, and the synthetic experiment."""

    p_1: Pressure
    """boundary between low and medium pressure"""
    p_2: Pressure
    """boundary between medium and high pressure"""
    model: Literal["eq-22", "eq-21"]
    """with (eq-22) or without (eq-21) a slow pair: a zero and a pole in either order"""
    fit: Literal["two-step", "joint"]
    """alternate between K, tau_L, T_L from steps and T1, T2 from sines (two-step), or fit all
    unknowns to all records (joint)"""
    turns: Annotated[int, Unit("1", 20), Field(ge=1, le=200)]
    """maximum number of iterations of the two-step fit; the paper uses 1"""
    plant: Literal["brake", "eq-22"]
    """synthetic: the whole brake with friction, or a linear model exactly as in eq. (22)"""
    p_low: Pressure
    """synthetic: mean pressure in the low-pressure region"""
    p_medium: Pressure
    """synthetic: mean pressure in the medium-pressure region"""
    p_high: Pressure
    """synthetic: mean pressure in the high-pressure region"""
    i_step: Current
    """synthetic: step height"""
    amplitude: Current
    """synthetic: sine amplitude"""
    f_zero: Frequency
    """synthetic eq-22: zero of the slow pair"""
    f_pole: Frequency
    """synthetic eq-22: pole of the slow pair"""
    sigma_p: Annotated[float, Unit("Pa", 2e3), Field(ge=0)]
    """synthetic: noise of the measured pressure"""
    sigma_i: Annotated[float, Unit("A", 5e-3), Field(ge=0)]
    """synthetic: noise of the measured current"""


FREQUENCIES = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0)
"""sines of the synthetic experiment [Hz]"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Identify eq. (22) in each pressure region.

    Parameters
    ----------
    data
        ``i``: current [A], ``p_mc``: pressure [Pa], both measured through the same filter, so that
        its lag cancels. Either dither is on or ``ecu.dither.waveform`` is off. Each region needs a
        current step from rest (1 s before, 4 s after the step), and sines from 1 to 15 Hz in
        steady state, one or several per record. The mean pressure determines a record's region.

    Raises
    ------
    ParameterError
        When a region's records do not determine its unknowns.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 5: eqs. (21), (22), Table 4, Fig. 6.
    """
    dither = par.ecu.dither
    f_dit = None if dither.waveform == "off" else dither.f_dit
    regions = regions_of(split(data), (options.p_1, options.p_2), f_dit)
    estimates: dict[str, Estimate] = {}
    figures: dict[str, tuple[float, str]] = {}
    checks: list[Check] = []
    for k, region in enumerate(regions):
        estimate = fit(
            region,
            par,
            joint=options.fit == "joint",
            turns=round(options.turns),
            pair=options.model == "eq-22",
        )
        estimates[region.name] = estimate
        figures |= _figures(region, estimate)
        checks += _checks(region, estimate)
        if effort.progress is not None:
            effort.progress("regions", (k + 1) / len(regions))
    return Identified(
        estimates=estimates,
        parameters={},
        figures=figures,
        checks=tuple(checks),
        curves=curves_of(regions, estimates, par),
        notes=(*map(_described, regions), *_without_pair(estimates)),
    )


def _without_pair(estimates: Mapping[str, Estimate]) -> tuple[str, ...]:
    names = [region for region, estimate in estimates.items() if not pair_shows(estimate)]
    if not names:
        return ()
    return (
        f"the data show no slow pair at {' and '.join(names)} pressure. Set model = 'eq-21' to "
        "estimate T1 and T2 more precisely",
    )


def pair_shows(estimate: Estimate) -> bool:
    """Return whether the slow pair's zero and pole differ by more than two standard deviations."""
    names = [u.name for u in estimate.unknowns]
    if not {"tau_L", "T_L"} <= set(names):
        return not {"tau_L", "T_L"} & {k.unknown.name for k in estimate.kept}
    contrast = np.zeros(len(names))
    contrast[names.index("tau_L")], contrast[names.index("T_L")] = 1.0, -1.0
    deviation = math.sqrt(max(float(contrast @ estimate.covariance @ contrast), 0.0))
    return abs(float(contrast @ estimate.values)) > 2.0 * deviation


def _described(region: Region) -> str:
    f = region.points.frequencies
    sines = (
        f"sines at {f.size} frequencies from {f[0]:.3g} to {f[-1]:.3g} Hz" if f.size else "no sines"
    )
    count = len(region.steps)
    return (
        f"{region.name} pressure (mean {region.pressure / 1e5:.3g} bar): "
        f"{count} step response{'' if count == 1 else 's'}, {sines}"
    )


def _figures(region: Region, estimate: Estimate) -> dict[str, tuple[float, str]]:
    """Return the gain, and the corner frequencies in the form of Table 4."""
    five = five_of(estimate)
    figures = {f"{region.name}.K": (five["K"], "Pa/A")}
    for name, T in list(five.items())[1:]:
        figures[f"{region.name}.f_{name}"] = (1.0 / (2.0 * math.pi * T), "Hz")
    return figures


def _checks(region: Region, estimate: Estimate) -> list[Check]:
    """Return the checks of how well eq. (22) describes the records."""
    name = region.name
    five = list(five_of(estimate).values())
    rests = [estimate[label] for label in estimate.names if label.endswith(":p_rest")]
    values = np.array([*five, *rests])
    whole = unknowns_of(region, dict(zip(NAMES, five, strict=True)))
    parts = [
        rest + response(values[:5], step.u, step.interval, step.block)[0] - step.pressure
        for rest, step in zip(rests, region.steps, strict=True)
    ]
    noise = np.concatenate([e / s.sigma for e, s in zip(parts, region.steps, strict=True)])
    error = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
    change = max(float(np.ptp(step.pressure)) for step in region.steps)
    checks = [
        Check(
            f"{name}.misfit_step",
            error / change,
            limit=_MISFIT_STEP,
            note="step: rms error relative to the pressure change",
        ),
        Check(
            f"{name}.step_residual_over_noise",
            float(np.sqrt(np.mean(noise**2))),
            note="about 1 if the residual is only noise",
        ),
    ]
    if region.points.frequencies.size:
        e, _ = over_frequency(region, whole).evaluate(values)
        size = e * np.repeat(region.points.deviation, 2)
        checks.append(
            Check(
                f"{name}.misfit_sines",
                float(np.sqrt(np.mean(size**2))),
                limit=_MISFIT_SINES,
                note="sines: rms error of relative magnitude and phase [rad]",
            )
        )
    return checks


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return simulated steps and sines in all three regions, with sensor noise."""
    pressures = _pressures(options)
    changes = demands(options.i_step, options.amplitude, FREQUENCIES)
    noise = (options.sigma_p, options.sigma_i, seed)
    if options.plant == "brake":
        return joined(of_brake(par, pressures, changes, *noise))
    models = {
        name: (p, eq22_of(par, p, options.f_zero, options.f_pole)) for name, p in pressures.items()
    }
    return joined(of_eq22(models, par, changes, *noise))


def _pressures(options: Options) -> dict[str, float]:
    return {"low": options.p_low, "medium": options.p_medium, "high": options.p_high}


def truth(par: MotorcycleParameters, options: Options) -> Mapping[str, float]:
    """Return the true values of the linear synthetic brake; raise for the whole brake."""
    if options.plant == "brake":
        raise ParameterError(
            "the whole brake has no true values for eq. (22). Set plant = 'eq-22' to compare "
            "estimates with the values of the simulation",
            name="plant",
            valid="'eq-22'",
        )
    values = {}
    for region, p in _pressures(options).items():
        model = eq22_of(par, p, options.f_zero, options.f_pole)
        pole, slow, fast = sorted(model.poles_hz)
        corners = {"tau_L": float(model.zeros_hz[0]), "T1": slow, "T2": fast, "T_L": pole}
        values[f"{region}:K"] = model.gain
        for name, f in corners.items():
            values[f"{region}:{name}"] = 1.0 / (2.0 * math.pi * float(f))
    return values


METHOD = Method(
    name="braking-dynamics",
    assembly="motorcycle-brake",
    summary="transfer function from current to pressure by region (Table 4 of Dardanelli et al.)",
    experiment="pressure-step",
    signals={"i": "A", "p_mc": "Pa"},
    options=Options,
    defaults=Options(
        p_1=10e5,
        p_2=35e5,
        model="eq-22",
        fit="joint",
        turns=20,
        plant="brake",
        p_low=5e5,
        p_medium=25e5,
        p_high=37e5,
        i_step=0.35,
        amplitude=0.1,
        f_zero=0.096,
        f_pole=0.104,
        sigma_p=2e3,
        sigma_i=5e-3,
    ),
    identify=identify,
    synthetic=synthetic,
    several=True,
    simulated=(
        "plant",
        "p_low",
        "p_medium",
        "p_high",
        "i_step",
        "amplitude",
        "f_zero",
        "f_pole",
        "sigma_p",
        "sigma_i",
    ),
    truth=truth,
    further={
        "K": ("Pa/A", "gain from current to pressure in each region"),
        "tau_L": ("s", "zero of the slow pair"),
        "T_L": ("s", "pole of the slow pair"),
        "T1": ("s", "slower pole of the drive"),
        "T2": ("s", "faster pole of the drive"),
        "p_rest": ("Pa", "pressure before each step"),
    },
)
