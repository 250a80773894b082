"""Valve cycle: fixed commands fill the wheel, release it, hold it, and build it up in pulses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.authoring import (
    Array,
    Case,
    Duration,
    Experiment,
    Figures,
    Kpi,
    ParameterSet,
    Recordings,
    Unit,
)
from bywire.plant import stiffening_caliper
from one_box.rigs.corner import OneBoxCorner, OneBoxCornerParameters, rolling
from one_box.trim import memory_at, state_at

HeldPressure = Annotated[float, Unit("Pa", 1e7), Field(gt=0, allow_inf_nan=False)]
_FIRST = 3
FIGURES = Figures(
    pressure_low=("Pa", f"Smallest wheel pressure after {_FIRST} cycles."),
    pressure_high=("Pa", f"Largest wheel pressure after {_FIRST} cycles."),
    given_volume=("m**3", "Fluid that the plunger gave to the wheel."),
    pumped_volume=("m**3", "Fluid that the pump returned."),
    accumulator_end=("m**3", "Volume in the accumulator at the end."),
    accumulator_max=("m**3", "Largest volume in the accumulator."),
    wheel_volume=("m**3", "Volume that the caliper absorbed at the end."),
    plunger_low=("Pa", "Smallest plunger pressure."),
    volume_error=("m**3", "Largest residual of the fluid volume balance."),
)


class Options(ParameterSet):
    """The commands. The plunger holds its pressure before the inlet valve opens."""

    p_hold: HeldPressure
    """pressure that the plunger holds"""
    t_fill: Duration
    """duration of the first build-up"""
    t_cycle: Duration
    """time between two releases"""
    t_release: Duration
    """duration of a release, and of the hold after it"""
    t_pulse: Duration
    """time between two pulses of the inlet valve"""
    t_open: Duration
    """duration of a pulse"""
    duration: Duration
    """recording time"""


def commands(t: Array, options: Options) -> Mapping[str, Array]:
    """Return the commands, of which each lasts from a sample to the next."""
    now = t + 1e-9
    phase = np.mod(now - options.t_fill, options.t_cycle)
    fills = (now >= 0.0) & (now < options.t_fill)
    cycles = now >= options.t_fill
    releases = cycles & (phase < options.t_release)
    built = phase - 2.0 * options.t_release
    pulses = cycles & (built >= 0.0) & (np.mod(built, options.t_pulse) < options.t_open)
    return {
        "p_set": np.full(t.shape, options.p_hold),
        "close_set": np.where(fills | pulses, 0.0, 1.0),
        "release_set": np.where(releases, 1.0, 0.0),
        "pump_set": np.ones(t.shape),
    }


def cases(par: OneBoxCornerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    driven = par.replace({"drive": "pressure", "antilock.abs": "off"})
    return (
        Case(
            "run",
            OneBoxCorner(),
            driven,
            *_held(driven, options),
            lambda t: commands(t, options),
            options.duration,
            start=lambda par: _held(par, options),
        ),
    )


def _held(par: OneBoxCornerParameters, options: Options) -> tuple[object, object]:
    """Return a car at rest: the plunger holds its pressure, the wheel has none, the pump runs."""
    state, memory = rolling(par, 0.0)
    held = state_at(options.p_hold, par, wheel=0.0)._asdict() | {
        "x_in": 0.0,
        "omega_p": par.supply.V_bat / par.pump_motor.K_e,
    }
    kept = memory_at(options.p_hold, par, wheel=0.0)._asdict()
    on = {"close": 1.0, "close_on": 1.0, "pump": 1.0}
    return state._replace(**held), memory._replace(**kept, **on)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of pressures and volumes."""
    run = recordings["run"]
    p, V = run["p"].values, run["V_acc"].values
    begin = options.t_fill + _FIRST * options.t_cycle
    late = p[run["time"].values > min(begin, 0.9 * options.duration)]
    par = OneBoxCornerParameters.model_validate_json(run.attrs["parameters"])
    end = stiffening_caliper.State(float(p[-1]))
    return FIGURES(
        pressure_low=float(late.min()),
        pressure_high=float(late.max()),
        given_volume=_grown(run, "V_filled"),
        pumped_volume=_grown(run, "V_pumped"),
        accumulator_end=float(V[-1]),
        accumulator_max=float(V.max()),
        wheel_volume=float(stiffening_caliper.volume(end, par.caliper)),
        plunger_low=float(run["p_mc"].min()),
        volume_error=float(abs(run["V_missing"] - run["V_missing"][0]).max()),
    )


def _grown(run: xr.Dataset, name: str) -> float:
    return float(run[name][-1] - run[name][0])


EXPERIMENT = Experiment(
    name="valve-cycle",
    assembly="one-box-corner",
    summary="fixed valve commands at {p_hold:bar}, with a release every {t_cycle:ms}",
    options=Options,
    defaults=Options(
        p_hold=120e5,
        t_fill=0.15,
        t_cycle=0.1,
        t_release=0.02,
        t_pulse=0.015,
        t_open=0.006,
        duration=0.95,
    ),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
