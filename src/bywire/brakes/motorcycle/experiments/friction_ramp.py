"""Friction ramp: a slow current ramp up and down, with and without dither (2010, Fig. 5)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import hysteresis, occupation
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.stimuli import ramp
from bywire.brakes.motorcycle.case import case_from_rest, smoothing
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, CurrentRate, Frequency, TimeConstant
from bywire.data.recursive_filter import low_passed

if TYPE_CHECKING:
    import xarray as xr

WITHOUT, WITH = "without-dither", "with-dither"

PEAK = Figures(p_max=("Pa", "Maximum master-cylinder pressure."))
RATIO = Figures(
    loop_area_ratio=("1", "Loop area with dither, relative to the area without dither.")
)


class Options(ParameterSet):
    """The ramp of eq. (17)."""

    i_max: Current
    """current demand at the turning point"""
    slope: CurrentRate
    """slope of the demand"""
    f_filter: Frequency
    """cutoff frequency of the first-order low-pass filter for the measured current"""
    smoothing: TimeConstant
    """moving average for the loop's KPIs; default: one dither period; 0: raw signals"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return both runs; each starts with a retracted piston and a closed current loop."""
    shape = ramp.Parameters(
        start=0.0, end=options.i_max, slope=options.slope, t_start=0.0, t_hold=0.0, after="return"
    )
    waveform = par.ecu.dither.waveform if par.ecu.dither.waveform != "off" else "sine"
    duration = 2.0 * options.i_max / options.slope
    return tuple(
        case_from_rest(
            label,
            par,
            "current",
            0.0,
            lambda t: {"i_set": ramp.sample(t, shape)},
            duration,
            {"ecu.dither.waveform": chosen},
        )
        for label, chosen in ((WITHOUT, "off"), (WITH, waveform))
    )


def finish(recording: xr.Dataset, options: Options) -> xr.Dataset:
    """Add the measured current after the low-pass filter, as in the paper's plot."""
    interval = float(recording["time"][1] - recording["time"][0])
    behind = low_passed(recording["i_meas"].values, options.f_filter, interval)
    attrs = {"units": "A", "long_name": "measured current, filtered"}
    return recording.assign(i_filtered=("time", behind, attrs))


def loop(options: Options) -> hysteresis.Setting:
    """Return the setting of the loops: filtered current versus pressure."""
    return hysteresis.Setting("i_filtered", "p_mc", options.smoothing, demand="i_star")


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return each loop's KPIs and their ratio."""
    loops: dict[str, Kpi] = {}
    setting = loop(options)
    for label, suffix in ((WITHOUT, "undithered"), (WITH, "dithered")):
        run = recordings[label]
        kpis = evaluate("hysteresis", run, setting) | evaluate(
            "occupation", run, occupation.Setting()
        )
        loops |= {
            f"{name}_{suffix}": replace(k, name=f"{name}_{suffix}") for name, k in kpis.items()
        }
        (peak,) = PEAK(f"_{suffix}", p_max=run["p_mc"].max())
        loops[peak.name] = peak
    plain = loops["loop_area_undithered"]
    ratio, note = math.nan, plain.note or "the loop area without dither is zero"
    if plain.value:
        ratio, note = loops["loop_area_dithered"].value / plain.value, plain.note
    return (*loops.values(), *RATIO(loop_area_ratio=(ratio, note)))


_LOOP = units_of("hysteresis", "occupation", resolved={"drive": "A", "drive*response": "A*Pa"})

EXPERIMENT = Experiment(
    name="friction-ramp",
    assembly="motorcycle-brake",
    summary="slow current ramp to {i_max} and back, with and without dither (Fig. 5 of "
    "Dardanelli et al.)",
    options=Options,
    defaults=Options(i_max=5.0, slope=0.2, f_filter=20.0, smoothing=0.02),
    cases=cases,
    judge=judge,
    kpis={
        f"{name}_{suffix}": unit
        for suffix in ("undithered", "dithered")
        for name, unit in {**_LOOP, **PEAK.units}.items()
    }
    | RATIO.units,
    figures=("hysteresis-loop", "time-traces"),
    finish=finish,
    loop=loop,
    following=smoothing,
)
