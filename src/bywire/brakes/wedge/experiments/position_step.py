"""Position step: both motors of the assembled brake follow a step within the clearance.

Roberts et al. (2003), section "Position control of wedge", report very little difference from
motors with only their screws, due to the high gear ratio. The experiment runs both for comparison.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.kpis.step_response import Setting
from bywire.brakes.wedge.case import case_from_parked, distinct, parameters_of, steps
from bywire.brakes.wedge.elements import brake_heart
from bywire.brakes.wedge.panels import COMPARED
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Position, Unit
from bywire.plant import roller_screw

if TYPE_CHECKING:
    import xarray as xr

BRAKE, SCREWS, MOTORS = "brake", "screws", "motors"
_BANDS = ("low", "high")
_AWAY = 1.0  # free play [m] that no motor crosses

STEP = ("rise_time", "overshoot", "settling_time", "steady_state_error")
CURRENT = Figures(
    peak_current=("A", "Maximum motor current."),
    current_limited=("%", "Fraction of the time after the step at the current limit."),
)
_REST = "maximum value over time and amplitudes, in % of the step."
OVERALL = Figures(
    difference_screws=(
        "%",
        f"Difference in mean angle from screws that preload each other without the wedge: {_REST}",
    ),
    difference_motors=(
        "%",
        f"Difference in mean angle from motors with free screws: {_REST}",
    ),
    normal_force=("N", "Maximum normal force, 0 if the steps stay within the clearance."),
)


def _tag(amplitude: float) -> str:
    """Return the name of an amplitude in labels and key figures, in thousandths of a radian."""
    return f"{1e3 * amplitude:.10g}mrad".replace(".", "p")


Amplitudes = Annotated[
    tuple[Annotated[float, Field(gt=0, allow_inf_nan=False)], ...],
    Unit("rad", 0.5),
    Field(min_length=1, max_length=100),
    AfterValidator(distinct(_tag, " rad")),
]


class Options(ParameterSet):
    """Steps from the parking position toward clamping on the positive side."""

    amplitudes: Amplitudes
    """step angles; the pads touch at a wedge travel of clearance / tan(alpha)"""
    f_low: Frequency
    """natural frequency of the low-bandwidth position loop"""
    f_high: Frequency
    """natural frequency of the high-bandwidth position loop"""
    delta: Position
    """offset of each screw, which preloads the wedge; default: the parameter set's value"""
    duration: Duration
    """recording time after each step"""
    settle: Duration
    """time at rest before each step"""


def following(par: WedgeParameters) -> Mapping[str, Any]:
    """Return the preload offset of the parameter set."""
    return {"delta": par.control.offset.delta_preload}


def _arrangements(par: WedgeParameters, delta: float) -> dict[str, dict[str, float]]:
    """Return the changes that remove the wedge, and those that also remove the other screw.

    Without the wedge, the screws push on each other tip to tip with the same force.
    """
    heart = par.heart
    c = brake_heart.compliances(heart)
    preload = max(0.0, (delta - 0.5 * (heart.g_1 + heart.g_2)) / c.wedge)
    together = -0.5 * (heart.g_12 + preload * c.tips)
    no_wedge = {"heart.g_1": _AWAY, "heart.g_2": _AWAY}
    return {
        BRAKE: {"control.offset.delta_preload": delta},
        SCREWS: {"control.offset.delta_preload": together, **no_wedge},
        MOTORS: {"control.offset.delta_preload": delta, **no_wedge, "heart.g_12": _AWAY},
    }


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return a run for every arrangement, bandwidth and amplitude."""
    bands = dict(zip(_BANDS, (options.f_low, options.f_high), strict=True))
    return tuple(
        _case(
            par,
            options,
            amplitude,
            f"{kind}-{band}-{_tag(amplitude)}",
            {"command.mode": "position", "control.position.f_n": f_n, **changes},
        )
        for kind, changes in _arrangements(par, options.delta).items()
        for band, f_n in bands.items()
        for amplitude in options.amplitudes
    )


def _case(
    par: WedgeParameters, options: Options, amplitude: float, label: str, changes: Mapping[str, Any]
) -> Case:
    apart = changes["control.offset.delta_preload"] / roller_screw.slope(par.screw)
    return case_from_parked(
        par,
        lambda t: {
            "theta_1_set": steps(t, {0.0: amplitude}) - apart,
            "theta_2_set": steps(t, {0.0: amplitude}) + apart,
        },
        options.duration,
        changes,
        label,
        settle=options.settle,
        keep=options.settle,
    )


def finish(run: xr.Dataset, _: Options) -> xr.Dataset:
    """Add the mean angle of both motors."""
    attrs = {"units": "rad", "long_name": "mean motor angle"}
    mean = 0.5 * (run["theta_1"].values + run["theta_2"].values)
    return run.assign(theta=("time", mean, attrs))


def _each(run: xr.Dataset, amplitude: float, ending: str) -> tuple[Kpi, ...]:
    """Return the key figures of one step of the assembled brake."""
    setting = Setting("theta", t_step=0.0, start=0.0, end=amplitude)
    step = evaluate("step_response", run, setting)
    after, par = run.sel(time=slice(-1e-9, None)), parameters_of(run)
    limit = min(par.control.position.i_max, par.drive.i_max) * (1.0 - 1e-9)
    demand, current = (
        np.maximum(np.abs(after[f"i_1{of}"].values), np.abs(after[f"i_2{of}"].values))
        for of in ("_ref", "")
    )
    return (
        *(replace(step[name], name=name + ending) for name in STEP),
        *CURRENT(
            ending,
            peak_current=current.max(),
            current_limited=100.0 * float(np.mean(demand >= limit)),
        ),
    )


def _over(recordings: Recordings, band: str, options: Options) -> tuple[Kpi, ...]:
    """Return the maximum differences from the setups without a wedge, over all amplitudes."""
    worst, touching = {SCREWS: 0.0, MOTORS: 0.0}, 0.0
    for amplitude in options.amplitudes:
        ending = f"-{band}-{_tag(amplitude)}"
        brake = recordings[BRAKE + ending]
        touching = max(touching, float(brake["F_N"].max()))
        for kind in worst:
            apart = np.abs(brake["theta"].values - recordings[kind + ending]["theta"].values)
            worst[kind] = max(worst[kind], 100.0 * float(apart.max()) / amplitude)
    note = "the pads touch the disc, so the step leaves the clearance" if touching > 0 else ""
    return OVERALL(
        f"_{band}",
        difference_screws=(worst[SCREWS], note),
        difference_motors=(worst[MOTORS], note),
        normal_force=(touching, note),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of each step, and the effect of the wedge."""
    each = [
        kpi
        for band, amplitude in product(_BANDS, options.amplitudes)
        for kpi in _each(
            recordings[f"{BRAKE}-{band}-{_tag(amplitude)}"], amplitude, f"_{band}_{_tag(amplitude)}"
        )
    ]
    return (*each, *(kpi for band in _BANDS for kpi in _over(recordings, band, options)))


def named(options: Options) -> dict[str, str]:
    """Return the unit of every key figure."""
    units = units_of("step_response", resolved={"level": "rad"})
    each = {name: units[name] for name in STEP} | CURRENT.units
    return {
        f"{name}_{band}_{_tag(amplitude)}": unit
        for band, amplitude in product(_BANDS, options.amplitudes)
        for name, unit in each.items()
    } | OVERALL.ending(*(f"_{band}" for band in _BANDS))


_DEFAULTS = Options(
    amplitudes=(0.25, 0.5, 1.0), f_low=12.0, f_high=60.0, delta=42e-6, duration=0.4, settle=0.05
)

EXPERIMENT = Experiment(
    name="position-step",
    assembly="wedge-brake",
    summary="steps of both motors within the clearance at two bandwidths, with and without the "
    "wedge",
    options=Options,
    defaults=_DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=named(_DEFAULTS),
    figures=("overlaid-traces",),
    compared=COMPARED,
    finish=finish,
    following=following,
    named=named,
)
