"""Sizing of the motorcycle actuator: gear ratio and motor power for a bandwidth and a pressure."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
import xarray as xr
from pydantic import Field, model_validator

from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.sizing import trial as actuator_trial
from bywire.brakes.motorcycle.sizing.demand import (
    Course,
    Motion,
    breakaway_current,
    geared,
    motion,
    sine,
    step,
)
from bywire.brakes.motorcycle.trim import highest_pressure
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency, GearRatio, Pressure, Unit
from bywire.core.typing import Array, Progress
from bywire.data.labeled import labeled
from bywire.synthesis.study import Cut, Findings, Map, Mark, Study, edge_warnings, require_ranges

# Options and assumptions of the study of the motorcycle actuator's gear and motor.

Count = Annotated[int, Unit("1", 41.0), Field(ge=3, le=401)]

ASSUMPTIONS = (
    "The gear ratio varies; motor, rotor inertia, battery, pistons, fluid and efficiency stay.",
    "The seals' friction is a force at the piston: at the shaft it grows with the gear ratio.",
    "The wanted pressure is reached exactly: flow through the pressure-volume curves of chamber, "
    "pipeline and caliper gives the speed; pressure, friction, efficiency and inertia the torque.",
    "Compliances are those at the middle of the course; the winding's inductance is left out.",
    "The seals slide; the current that breaks them away at the peak pressure must be there too.",
    "Dither is left out of the calculation; its current at the peak pressure is listed.",
    "Limits: the pressure controller's current limit, and the bridge's voltage at that current.",
    "On the bench the pressure controller's gains grow with the gear ratio; they are not tuned.",
)


class Options(ParameterSet):
    """What the actuator must do, and the designs to compare."""

    bandwidth: Frequency
    """frequency at which a sine of the amplitude, or a step, is followed"""
    p_peak: Pressure
    """largest pressure: crest of the sine, end of the step"""
    amplitude: Pressure
    """amplitude of the sine"""
    p_from: Pressure
    """begin of the step"""
    demand: Literal["sine", "step"]
    """what sizes the actuator"""
    k_g_min: GearRatio
    """smallest gear ratio"""
    k_g_max: GearRatio
    """largest gear ratio"""
    ratios: Count
    """number of gear ratios, evenly spread in their logarithm"""
    f_min: Frequency
    """lowest bandwidth of the map"""
    f_max: Frequency
    """highest bandwidth of the map"""
    frequencies: Count
    """number of bandwidths, evenly spread in their logarithm"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        ratios, bandwidths = ("k_g_min", "k_g_max", "m/rad"), ("f_min", "f_max", "Hz")
        require_ranges(self, (ratios, bandwidths, ("p_from", "p_peak", "Pa")))
        if not 2.0 * self.amplitude <= self.p_peak:
            raise ValueError(
                f"amplitude = {self.amplitude / 1e5:g} bar must be <= half of p_peak = "
                f"{self.p_peak / 1e5:g} bar: pressures cannot fall below zero"
            )
        return self


Par = MotorcycleParameters

# Many gear ratios of the motorcycle actuator beside each other, as a dataset.

SIZES = {
    "electrical": ("W", "largest electrical power"),
    "mechanical": ("W", "largest mechanical power"),
    "torque": ("N*m", "largest torque"),
    "speed": ("rad/s", "largest speed"),
    "current": ("A", "largest current"),
    "inertia_share": ("1", "inertia's torque over the whole"),
    "current_share": ("1", "current over its limit"),
    "voltage_share": ("1", "voltage over what there is"),
}
"""unit and label of what a motion takes"""


def sizes_of(par: Par, done: Motion, static: float) -> dict[str, float]:
    """Return the largest values of a motion, SI.

    Parameters
    ----------
    static
        Current [A] that breaks the piston away at the peak pressure: torque, current and power
        are at least what it takes.
    """
    torque = float(np.abs(done.torque).max())
    current = max(torque / par.motor.K_e, static)
    voltage = float(np.max(np.abs(done.voltage) / done.available))
    return {
        "electrical": max(float(done.electrical.max()), par.motor.R_m * static**2),
        "mechanical": float(done.mechanical.max()),
        "torque": max(torque, static * par.motor.K_e),
        "speed": float(np.abs(done.omega).max()),
        "current": current,
        "inertia_share": float(np.abs(done.inertia).max()) / torque,
        "current_share": current / par.ecu.pressure.i_max,
        # Where no voltage is left at this current, the share would change its sign.
        "voltage_share": voltage if bool((done.available > 0).all()) else np.inf,
    }


def mapped(
    par: Par,
    p_peak: float,
    ratios: Array,
    frequencies: Array,
    course: Callable[[Par, float], Course],
) -> xr.Dataset:
    """Return what all designs take at all bandwidths.

    Parameters
    ----------
    p_peak
        Largest pressure [Pa], at which the seals must break away.
    ratios, frequencies
        Gear ratios [m/rad], shape (n,), and bandwidths [Hz], shape (m,).
    course
        ``course(par, f)``: the wanted pressure at a bandwidth.

    Returns
    -------
    xarray.Dataset
        Dimensions ``k_g`` and ``frequency``, the variables of `SIZES`.
    """
    rows: list[list[dict[str, float]]] = []
    for k_g in ratios:
        brake = geared(par, float(k_g))
        static = breakaway_current(brake, p_peak)
        rows.append(
            [sizes_of(brake, motion(brake, course(brake, float(f))), static) for f in frequencies]
        )
    values = {name: [[sizes[name] for sizes in row] for row in rows] for name in SIZES}
    axes = {"k_g": (ratios, "m/rad", "gear ratio"), "frequency": (frequencies, "Hz", "bandwidth")}
    return labeled(axes, {name: (values[name], *SIZES[name]) for name in SIZES})


_ROWS = 13  # gear ratios of the table
_AT_EDGE = 1e-3  # share of an end of the range that counts as on it
_SLOWEST, _FASTEST = 1e-2, 1e3  # bandwidths among which the highest possible is searched [Hz]
_EXACT = 1e-12  # of the logarithm of a ratio or bandwidth that is searched


def course(par: Par, options: Options, f: float, demand: str = "") -> Course:
    """Return the wanted pressure at a bandwidth [Hz]."""
    if (demand or options.demand) == "sine":
        return sine(par, options.p_peak, options.amplitude, f)
    return step(par, options.p_from, options.p_peak, f)


def compute(par: Par, options: Options, progress: Progress) -> Findings:
    """Return power over gear ratio and bandwidth, the best ratio, and its trial on the bench.

    Raises
    ------
    ParameterError
        When the piston cannot reach the peak pressure.
    """
    highest = highest_pressure(par)
    if not options.p_peak < highest:
        raise ParameterError(
            f"p_peak = {options.p_peak / 1e5:g} bar is not valid: it must be < "
            f"{highest / 1e5:.4g} bar, where the piston meets its end stop: lower it, or move the "
            "stop (master_cylinder.x_end)"
        )
    data = _mapped(
        par,
        options,
        options.ratios,
        np.geomspace(options.f_min, options.f_max, options.frequencies),
    )
    k_best = _best_ratio(par, options)
    chosen = geared(par, k_best)
    f, power = options.bandwidth, float(_electrical(chosen, options).max())
    kpis = [
        Kpi("optimum_k_g", k_best, "m/rad", "Gear ratio that needs the least electrical power."),
        *_figures("optimum", chosen, options),
        Kpi("given_k_g", par.gear.k_g, "m/rad", "Gear ratio of the parameter set."),
        *_figures("given", par, options),
    ]
    warnings = _warnings(kpis, k_best, options)
    for n, (label, brake) in enumerate((("optimum", chosen), ("given", par))):
        progress("bench", 0.5 * n)
        kpis += actuator_trial.sine_figures(label, brake, options.p_peak, options.amplitude, f)
        kpis += actuator_trial.braking_figures(label, brake, options.p_from, options.p_peak)
    progress("bench", 1.0)
    marks = (Mark("optimum", k_best, f), Mark("given gear ratio", par.gear.k_g, f))
    limits = {"current limit": ("current_share", 1.0), "voltage limit": ("voltage_share", 1.0)}
    caption = f"Electrical power of the motor for a {options.demand}: {power:.3g} W at the optimum."
    maps = {"power": Map("electrical", "k_g", "frequency", caption, marks, limits)}
    return Findings(data, tuple(kpis), ASSUMPTIONS, maps, (_cut(par, options),), warnings)


def _at(par: Par, options: Options, f: float, demand: str = "") -> dict[str, float]:
    done = motion(par, course(par, options, f, demand))
    return sizes_of(par, done, breakaway_current(par, options.p_peak))


def _electrical(par: Par, options: Options) -> Array:
    return motion(par, course(par, options, options.bandwidth)).electrical


def _best_ratio(par: Par, options: Options) -> float:
    """Return the gear ratio [m/rad] of least electrical power."""
    from scipy.optimize import minimize_scalar

    def power(z: float) -> float:
        return _at(geared(par, math.exp(z)), options, options.bandwidth)["electrical"]

    # The power has one minimum: inertia falls with the ratio, the load grows with it.
    ends = (math.log(options.k_g_min), math.log(options.k_g_max))
    least = minimize_scalar(power, bounds=ends, method="bounded", options={"xatol": _EXACT})
    return math.exp(least.x)


def fastest(par: Par, options: Options, demand: str) -> float:
    """Return the highest bandwidth [Hz] within current and voltage limit; NaN for none."""
    from scipy.optimize import bisect

    def excess(z: float) -> float:
        sizes = _at(par, options, math.exp(z), demand)
        return max(sizes["current_share"], sizes["voltage_share"]) - 1.0

    low, high = math.log(_SLOWEST), math.log(_FASTEST)
    if excess(low) > 0.0:
        return math.nan
    # Bisection, because the share of the voltage is infinite where none is left.
    return math.exp(bisect(excess, low, high, xtol=_EXACT))


def _figures(label: str, par: Par, options: Options) -> list[Kpi]:
    sizes = _at(par, options, options.bandwidth)
    texts = {
        "electrical": "Largest electrical power of the motor, copper loss included.",
        "mechanical": "Largest mechanical power: the motor's rating.",
        "torque": "Largest torque, breakaway at the peak pressure included.",
        "speed": "Largest speed.",
        "current": "Largest current, breakaway at the peak pressure included.",
        "inertia_share": "Largest torque of rotor and piston inertia over the largest torque.",
        "voltage_share": "Largest voltage over what the bridge gives at its current.",
    }
    wanted = course(par, options, options.bandwidth)
    copper = par.motor.R_m * np.mean(motion(par, wanted).current ** 2)
    dither = par.ecu.est_par
    A_dit = dither.k_brk_p * (dither.T_pr + dither.f_cfr_p * options.p_peak) / dither.K_e
    note = "" if par.ecu.dither.waveform != "off" else "dither is off"
    return [
        *(
            Kpi(f"{label}_{name}", sizes[name], SIZES[name][0], text)
            for name, text in texts.items()
        ),
        Kpi(f"{label}_copper", float(copper), "W", "Mean copper loss over the course."),
        Kpi(
            f"{label}_dither_current",
            A_dit * par.ecu.dither.gain,
            "A",
            "Amplitude of the dither's current at the peak pressure, eq. (20).",
            note,
        ),
        *(
            Kpi(
                f"{label}_fastest_{kind}",
                fastest(par, options, kind),
                "Hz",
                f"Highest bandwidth of the {kind} within current and voltage limit.",
            )
            for kind in ("sine", "step")
        ),
    ]


def _mapped(par: Par, options: Options, ratios: int, frequencies: Array) -> xr.Dataset:
    k_g = np.geomspace(options.k_g_min, options.k_g_max, ratios)
    return mapped(par, options.p_peak, k_g, frequencies, lambda brake, f: course(brake, options, f))


def _cut(par: Par, options: Options) -> Cut:
    """Return what changes along the gear ratio at the bandwidth wanted."""
    row = _mapped(par, options, _ROWS, np.array([options.bandwidth])).isel(frequency=0)
    names = (
        "electrical",
        "mechanical",
        "torque",
        "speed",
        "inertia_share",
        "current_share",
        "voltage_share",
    )
    return Cut(f"{options.demand} at a bandwidth of {options.bandwidth:g} Hz", row, ("k_g", *names))


def _warnings(kpis: list[Kpi], k_best: float, options: Options) -> tuple[str, ...]:
    value = {kpi.name: kpi.value for kpi in kpis}
    warnings: list[str] = []
    fast = value[f"optimum_fastest_{options.demand}"]
    if not fast >= options.bandwidth:
        warnings.append(
            f"this motor cannot follow the {options.demand} at {options.bandwidth:g} Hz: at the "
            f"best gear ratio its limits allow {fast:.3g} Hz"
        )
    ends = (options.k_g_min, options.k_g_max)
    return (*warnings, *edge_warnings("k_g", k_best, ends, "m/rad", _AT_EDGE))


STUDY = Study(
    name="actuator-sizing",
    assembly="motorcycle-brake",
    summary="gear ratio and motor power for a bandwidth and a peak pressure, and their trial",
    options=Options,
    defaults=Options(
        bandwidth=10.0,
        p_peak=37e5,
        amplitude=3e5,
        p_from=6e5,
        demand="sine",
        k_g_min=1e-4,
        k_g_max=1e-3,
        ratios=41,
        f_min=1.0,
        f_max=30.0,
        frequencies=31,
    ),
    compute=compute,
    ruled={
        "drive.mode": "the study demands pressures",
        "pedal": "the study demands pressures without it",
    },
)
