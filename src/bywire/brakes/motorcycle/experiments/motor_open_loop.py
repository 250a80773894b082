"""Open loop: any stimulus at the motor, from an ideal source or through the ECU."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import effort, occupation
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimulus import Stimulus, required_stimulus
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.experiments.friction_ramp import PEAK
from bywire.brakes.motorcycle.parameters import DriveMode, MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit

if TYPE_CHECKING:
    import xarray as xr

_SOURCES: dict[str, tuple[DriveMode, str, str]] = {
    "current": ("current-source", "i_set", "A"),
    "voltage": ("voltage-source", "v_set", "V"),
    "current-loop": ("current", "i_set", "A"),
    "current-direct": ("current-direct", "i_set", "A"),
    "pressure": ("pressure", "p_set", "Pa"),
}  # drive mode, driven signal and its unit
_IDEAL = ("current", "voltage")
# Signals and key figures that need the ECU.
_SIGNALS = ("p_ref", "duty", "i_star", "i_dit", "sat_current", "sat_duty")
_KPIS = ("share_sat_current", "share_sat_duty")


class Options(ParameterSet):
    """The source."""

    source: Literal["current", "voltage", "current-loop", "current-direct", "pressure"]
    """driven quantity: an ideal source, or a demand to the ECU; -direct bypasses the dither"""
    add_holding: bool
    """whether to add the current, voltage or pressure that holds p_start to the stimulus"""
    p_start: Annotated[float, Unit("Pa", 2e6), Field(ge=0, allow_inf_nan=False)]
    """equilibrium pressure at which the run starts"""
    duration: Duration
    """duration of the run"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before t = 0, at the first value of the stimulus"""


def cases(
    par: MotorcycleParameters, options: Options, stimulus: Stimulus | None
) -> tuple[Case, ...]:
    """Return the single run."""
    stimulus = required_stimulus(stimulus, "motor-open-loop")
    mode, name, unit = _SOURCES[options.source]
    i = holding_current(options.p_start, par)
    holding = {"A": i, "V": par.motor.R_m * i, "Pa": options.p_start}[unit]
    offset = holding if options.add_holding else 0.0
    return (
        case_from_rest(
            "run",
            par,
            mode,
            options.p_start,
            lambda t: {name: offset + stimulus.sample(t)},
            options.duration,
            settle=options.settle,
            record=options.record,
        ),
    )


def finish(recording: xr.Dataset, options: Options) -> xr.Dataset:
    """Drop the signals that need the ECU if an ideal source replaces it."""
    return recording.drop_vars(_SIGNALS) if options.source in _IDEAL else recording


def without(options: Options) -> tuple[str, ...]:
    """Return the KPIs that need the ECU if an ideal source replaces it, otherwise none."""
    return _KPIS if options.source in _IDEAL else ()


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return effort and utilization."""
    run = recordings["run"]
    kpis = evaluate("effort", run, effort.Setting())
    kpis |= evaluate("occupation", run, occupation.Setting())
    kept = (kpi for name, kpi in kpis.items() if name not in without(options))
    return (*kept, *PEAK(p_max=run["p_mc"].max()))


EXPERIMENT = Experiment(
    name="motor-open-loop",
    formerly="open-loop",
    assembly="motorcycle-brake",
    summary="any stimulus as an ideal current or voltage, or as a demand to the ECU",
    options=Options,
    defaults=Options(
        source="current", add_holding=False, p_start=0.0, duration=1.0, record=1e-3, settle=0.0
    ),
    cases=cases,
    judge=judge,
    kpis={**units_of("effort", "occupation"), **PEAK.units},
    figures=("time-traces", "energy-balance"),
    finish=finish,
    driven_unit=lambda options: _SOURCES[options.source][2],
    without=without,
    begins_at={"p_start": "p_mc"},
)
