"""Release: from full braking back to an empty caliper."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import effort, occupation, release
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.registry import evaluate, units_of
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.motorcycle.case import case_from_rest, step_at_zero
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Pressure, TimeConstant


class Options(ParameterSet):
    """The release maneuver."""

    p_from: Pressure
    """pressure that is released"""
    how: Literal["controlled", "current-off"]
    """pressure demand ramped to zero in closed loop, or current demand cut to zero"""
    t_ramp: TimeConstant
    """time in which the pressure demand falls to zero (how = "controlled")"""
    p_empty: Pressure
    """caliper pressure below which the brake counts as empty"""
    duration: Duration
    """time recorded after the release begins"""
    settle: TimeConstant
    """time before the release in which dither and loop settle"""


def cases(
    par: MotorcycleParameters, options: Options, _: Stimulus | None = None
) -> tuple[Case, ...]:
    """Return the one run."""
    keep = min(options.settle, 0.1)
    if options.how == "current-off":
        # Without dither: an ECU that has switched its current off does not shake the piston.
        return (
            case_from_rest(
                "run", par, "current-direct", options.p_from,
                step_at_zero("i_set", holding_current(options.p_from, par), 0.0),
                options.duration, {"ecu.dither.waveform": "off"}, settle=options.settle, keep=keep,
            ),
        )  # fmt: skip
    ramp = max(options.t_ramp, 1e-9)
    return (
        case_from_rest(
            "run", par, "pressure", options.p_from,
            lambda t: {"p_set": options.p_from * np.clip(1.0 - t / ramp, 0.0, 1.0)},
            options.duration, settle=options.settle, keep=keep,
        ),
    )  # fmt: skip


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return time to empty, residual pressure, energies."""
    run = recordings["run"]
    after = run.sel(time=slice(-1e-9, None))
    fallen = evaluate("release", run, release.Setting("p_pd", options.p_empty))
    time = after["time"].values
    power = after["P_el"].values
    fed_back = float(np.trapezoid(np.minimum(power, 0.0), time))
    stored = after["E_stored"].values
    own = (
        fallen["time_to_empty"],
        replace(fallen["residual_level"], name="residual_pressure"),
        Kpi("energy_stored", float(stored[0] - stored[-1]), "J",
            "Stored energy that the release sets free."),
        Kpi("energy_returned", float(after["W_shaft"].values[0] - after["W_shaft"].values[-1]), "J",
            "Work that the gear gives back to the motor's shaft, net."),
        Kpi("energy_fed_back", -fed_back, "J",
            "Electrical energy fed back into the battery, from recorded samples."),
        Kpi("energy_gear", float(after["E_gear"].values[-1] - after["E_gear"].values[0]), "J",
            "Loss of gear and screw; negative where the paper's law gives energy."),
    )  # fmt: skip
    found = evaluate("effort", run, effort.Setting())
    found |= evaluate("occupation", run, occupation.Setting())
    return (*own, *found.values())


EXPERIMENT = Experiment(
    name="release",
    assembly="motorcycle-brake",
    summary="release from 37 bar: time to empty, residual pressure, energy returned",
    options=Options,
    defaults=Options(
        p_from=37e5, how="controlled", t_ramp=0.2, p_empty=0.5e5, duration=1.5, settle=1.0
    ),
    cases=cases,
    judge=judge,
    kpis={
        "time_to_empty": "s",
        "residual_pressure": "Pa",
        "energy_stored": "J",
        "energy_returned": "J",
        "energy_fed_back": "J",
        "energy_gear": "J",
        **units_of("effort", "occupation"),
    },
    figures=("time-traces", "energy-balance"),
)
