"""Release: from full braking back to an empty caliper."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import effort, occupation, release
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.motorcycle.case import case_from_rest, step_at_zero
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Pressure, TimeConstant

ENERGIES = Figures(
    energy_stored=("J", "Released stored energy."),
    energy_returned=("J", "Net work that the gear returns to the motor shaft."),
    energy_fed_back=("J", "Electrical energy returned to the battery, from recorded samples."),
    energy_gear=("J", "Loss of gear and screw; negative if the paper's law creates energy."),
)


class Options(ParameterSet):
    """The release maneuver."""

    p_from: Pressure
    """pressure at the start of the release"""
    how: Literal["controlled", "current-off"]
    """pressure demand ramp to zero in closed loop, or current demand step to zero"""
    t_ramp: TimeConstant
    """time for the pressure demand to fall to zero (how = "controlled")"""
    p_empty: Pressure
    """caliper pressure below which the brake is considered fully released"""
    duration: Duration
    """recording time after the release begins"""
    settle: TimeConstant
    """time before the release for dither and loop to settle"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    keep = min(options.settle, 0.1)
    if options.how == "current-off":
        # Without dither, because an ECU with its current off does not dither the piston.
        return (
            case_from_rest(
                "run",
                par,
                "current-direct",
                options.p_from,
                step_at_zero("i_set", holding_current(options.p_from, par), 0.0),
                options.duration,
                {"ecu.dither.waveform": "off"},
                settle=options.settle,
                keep=keep,
            ),
        )
    ramp = max(options.t_ramp, 1e-9)
    return (
        case_from_rest(
            "run",
            par,
            "pressure",
            options.p_from,
            lambda t: {"p_set": options.p_from * np.clip(1.0 - t / ramp, 0.0, 1.0)},
            options.duration,
            settle=options.settle,
            keep=keep,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return time to empty, residual pressure and energies."""
    run = recordings["run"]
    after = run.sel(time=slice(-1e-9, None))
    fallen = evaluate("release", run, release.Setting("p_pd", options.p_empty))
    fed_back = np.trapezoid(np.minimum(after["P_el"].values, 0.0), after["time"].values)
    energies = {name: after[name].values for name in ("E_stored", "W_shaft", "E_gear")}
    gained = {name: values[-1] - values[0] for name, values in energies.items()}
    fallen_to = (
        fallen["time_to_empty"],
        replace(fallen["residual_level"], name="residual_pressure"),
        *ENERGIES(
            energy_stored=-gained["E_stored"],
            energy_returned=-gained["W_shaft"],
            energy_fed_back=-fed_back,
            energy_gear=gained["E_gear"],
        ),
    )
    totals = evaluate("effort", run, effort.Setting())
    totals |= evaluate("occupation", run, occupation.Setting())
    return (*fallen_to, *totals.values())


EXPERIMENT = Experiment(
    name="pressure-release",
    formerly="release",
    assembly="motorcycle-brake",
    summary="release from {p_from}: release time, residual pressure, returned energy",
    options=Options,
    defaults=Options(
        p_from=37e5, how="controlled", t_ramp=0.2, p_empty=0.5e5, duration=1.5, settle=1.0
    ),
    cases=cases,
    judge=judge,
    kpis={
        "time_to_empty": "s",
        "residual_pressure": "Pa",
        **ENERGIES.units,
        **units_of("effort", "occupation"),
    },
    figures=("time-traces", "energy-balance"),
)
