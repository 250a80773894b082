"""Moment tests of Roberts et al. (2003): pulses (Fig. 7), a ramp (Fig. 8), a large pulse (Fig. 9).

The text on these figures does not state any times, so we chose them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, model_validator

from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    along_disc,
    case_from_parked,
    first,
    mean,
    parameters_of,
    parking_time,
    release_time,
    steps,
    swing,
)
from bywire.brakes.wedge.laws.moment_control import SomeMoment, SpeedLimit
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Fraction, Unit
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

Count = Annotated[int, Unit("1", 3.0), Field(ge=1, le=100)]

# --- Key figures of all maneuvers

BRAKING_FIGURES = Figures(
    contact_time=("s", "Time to pad contact."),
    time_to_90=("s", "Time until the measured moment first reaches 90 % of the demand."),
    peak_power=("W", "Maximum power at the drives' input."),
    peak_power_filtered=("W", "Maximum power at the drives' input after the rig's filter."),
    peak_normal_force=("N", "Maximum normal force."),
    caliper_energy=("J", "Maximum energy stored in the caliper before the demand changes."),
    disc_share=("%", "Fraction of that energy supplied by the disc (self-reinforcement)."),
    rate_limited=("%", "Fraction of time at the software rate limit until the demand changes."),
    peak_speed=("rad/s", "Maximum speed of motor 1."),
    energy_in=("J", "Energy at the drives' input, including standby."),
    energy_braked=("J", "Energy taken from the disc."),
    energy_left=("J", "Maximum residual of the energy balance, which is the numerical error."),
    undefined="the signal does not reach the level in this time",
)
"""key figures of braking"""


def _braking(run: xr.Dataset, target: float, end: float) -> tuple[Kpi, ...]:
    """Return the key figures of braking that begins at time zero.

    ``run``: recording, positive in the disc's direction; ``target``: demanded moment [N m];
    ``end``: time of the first demand change [s].
    """
    after = run.sel(time=slice(-1e-9, None))
    held = run.sel(time=slice(-1e-9, end + 1e-9))
    peak = int(np.argmax(held["U_caliper"].values))
    stored = float(held["U_caliper"].values[peak])
    work = float(held["W_disc"].values[peak] - held["W_disc"].values[0])
    share = (
        (100.0 * work / stored, "") if stored > 0 else (math.nan, "the caliper stores no energy")
    )
    return BRAKING_FIGURES(
        contact_time=_contact(held),
        time_to_90=first(held, "y_M", 0.9 * target),
        peak_power=after["P_in"].max(),
        peak_power_filtered=after["P_meas"].max(),
        peak_normal_force=after["F_N"].max(),
        caliper_energy=stored,
        disc_share=share,
        rate_limited=100.0 * float(held["sat_rate"].mean()),
        peak_speed=np.abs(after["omega_1"]).max(),
        energy_in=_gained(after, "W_supply"),
        energy_braked=_gained(after, "W_brake"),
        energy_left=np.abs(energy_residual(run)).max(),
    )


def _contact(held: xr.Dataset) -> float:
    """Return the time [s] of first contact. Without clearance the pads touch from the start."""
    return 0.0 if parameters_of(held).caliper.clearance == 0.0 else first(held, "F_N", 0.0)


def _gained(run: xr.Dataset, name: str) -> float:
    return float(run[name].values[-1] - run[name].values[0])


def _too_coarse(run: xr.Dataset, begin: float, end: float, rows: int = 1) -> str:
    """Return why rows are too far apart to evaluate a moment between two times [s], or "".

    Parameters
    ----------
    rows
        Minimum number of rows in that time. A disc revolution needs five rows. With fewer rows the
        oscillation due to runout would alias.
    """
    t = run["time"].values
    apart = float(np.diff(t).max()) if t.size > 1 else math.inf
    speed = float(np.abs(run["Omega"].values).max())
    fifth = 0.4 * math.pi / speed if speed > 0 else math.inf
    inside = np.count_nonzero((t >= begin - 1e-9) & (t <= end + 1e-9))
    if inside >= rows and apart <= 1.05 * fifth:  # the message rounds the interval
        return ""
    interval = min((end - begin) / rows, fifth)
    return (
        f"the recording interval of {apart:.3g} s is too long between t = {begin:.4g} s and "
        f"{end:.4g} s. Record every {interval:.2g} s or more often"
    )


# --- A step, then pulses to 80 % (Fig. 7)

_OVER = "over the hold's last disc revolution, or over its second half if that is shorter"
PULSES_FIGURES = Figures(
    hold_moment=("N*m", f"Mean moment {_OVER}."),
    hold_error=(
        "%",
        "Relative error of that moment. It is far below 0 if the brake cannot reach the demand.",
    ),
    hold_ripple=("N*m", f"Peak-to-peak moment {_OVER}, due to disc runout."),
    hold_power=("W", f"Mean input power {_OVER}, including standby."),
    brake_power=("W", f"Mean braking power {_OVER}."),
    pulse_moment=(
        "N*m",
        "Mean moment over the first pulse's last disc revolution, or over the pulse's last fifth "
        "if the pulse is shorter.",
    ),
)


class PulsesOptions(ParameterSet):
    """The braking maneuver."""

    M_high: SomeMoment
    """moment demand"""
    low: Fraction
    """fraction of the moment to which the pulses fall"""
    t_hold: Duration
    """time from the step to the first pulse"""
    t_low: Duration
    """length of each pulse"""
    t_high: Duration
    """time between pulses, and after the last one"""
    pulses: Count
    """number of pulses"""
    settle: Duration
    """time parked before the step"""


def pulses(par: WedgeParameters, options: PulsesOptions, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    levels = {0.0: options.M_high}
    period = options.t_low + options.t_high
    for k in range(options.pulses):
        begin = options.t_hold + k * period
        levels[begin] = options.low * options.M_high
        levels[begin + options.t_low] = options.M_high
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            options.t_hold + options.pulses * period,
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge_pulses(recordings: Recordings, options: PulsesOptions) -> tuple[Kpi, ...]:
    """Return the key figures of the braking, the hold and the pulses."""
    run = along_disc(recordings["run"])
    begin, end = _turn(run, 0.0, options.t_hold, 0.5)
    held = _too_coarse(run, begin, end)
    hold, power = (math.nan if held else mean(run, name, begin, end) for name in ("M_B", "P_in"))
    ripple = math.nan if held else swing(run, "M_B", begin, end)
    figures = PULSES_FIGURES(
        hold_moment=(hold, held),
        hold_error=(100.0 * (hold / options.M_high - 1.0), held),
        hold_ripple=(ripple, held),
        hold_power=(power, held),
        brake_power=(hold * mean(run, "Omega", begin, end), held),
        pulse_moment=_pulse(run, options),
    )
    return (*_braking(run, options.M_high, options.t_hold), *figures)


def _turn(run: xr.Dataset, begin: float, end: float, last: float) -> tuple[float, float]:
    """Return the evaluated part of an interval [s], without the rows at its ends.

    The part is the disc's last revolution, over which the runout averages out. If the interval is
    shorter than a revolution, the part is the last fraction ``last`` of the interval.
    """
    nearest = int(np.abs(run["time"].values - end).argmin())
    speed = abs(float(run["Omega"].values[nearest]))
    whole = speed * (end - begin) >= 2.0 * math.pi
    start = end - (2.0 * math.pi / speed if whole else last * (end - begin))
    return start + 2e-9, end - 2e-9


def _pulse(run: xr.Dataset, options: PulsesOptions) -> tuple[float, str]:
    """Return the first pulse's moment, averaged over a revolution to remove the runout."""
    begin, end = _turn(run, options.t_hold, options.t_hold + options.t_low, 0.2)
    problem = _too_coarse(run, begin, end)
    return math.nan if problem else mean(run, "M_B", begin, end), problem


MOMENT_PULSES = Experiment(
    name="moment-pulses",
    assembly="wedge-brake",
    summary="moment step to {M_high}, then pulses to {low:%} (Fig. 7 of Roberts et al.)",
    options=PulsesOptions,
    defaults=PulsesOptions(
        M_high=200.0, low=0.8, t_hold=0.5, t_low=0.2, t_high=0.2, pulses=3, settle=0.05
    ),
    cases=pulses,
    judge=judge_pulses,
    kpis=BRAKING_FIGURES.units | PULSES_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)


# --- A step, a reduction, and a slow ramp back (Fig. 8)

_ROWS = 10  # minimum number of rows on the ramp

RAMP_FIGURES = Figures(
    ramp_error_mean=("N*m", "Mean difference between demand and moment on the ramp."),
    ramp_error_rms=(
        "N*m",
        "Root-mean-square difference between demand and moment on the ramp, including runout.",
    ),
    ramp_slope=("N*m/s", "Slope of a line through the moment on the ramp."),
)


class RampOptions(ParameterSet):
    """The braking maneuver."""

    M_high: SomeMoment
    """moment demand at the start and at the end of the ramp"""
    M_low: SomeMoment
    """moment from which the ramp starts"""
    t_hold: Duration
    """time from the step to the reduction"""
    t_low: Duration
    """time at the lower moment"""
    t_ramp: Duration
    """length of the ramp"""
    t_end: Duration
    """recording time after the ramp"""
    settle: Duration
    """time parked before the step"""

    @model_validator(mode="after")
    def _rises(self) -> RampOptions:
        if self.M_low > self.M_high:
            reason = "the ramp rises from M_low to M_high"
            valid = f"<= M_high = {self.M_high:g} N*m"
            raise RuleError("M_low", f"{self.M_low:g} N*m", valid, reason)
        return self


def _ramp_demand(t: Array, options: RampOptions) -> Array:
    """Return the moment demand [N m] at times t [s], shape (len(t),)."""
    begin = options.t_hold + options.t_low
    ramp = np.clip((t - begin) / options.t_ramp, 0.0, 1.0)
    stepped = steps(t, {0.0: options.M_high, options.t_hold: options.M_low})
    return stepped + (options.M_high - options.M_low) * ramp


def ramp(par: WedgeParameters, options: RampOptions, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    duration = options.t_hold + options.t_low + options.t_ramp + options.t_end
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": _ramp_demand(t, options)},
            duration,
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge_ramp(recordings: Recordings, options: RampOptions) -> tuple[Kpi, ...]:
    """Return the key figures of the braking, and the tracking errors on the ramp."""
    run = along_disc(recordings["run"])
    begin = options.t_hold + options.t_low
    end = begin + options.t_ramp
    problem = _too_coarse(run, begin, end, _ROWS)
    error, rms, slope = (math.nan,) * 3 if problem else _followed(run, begin, end)
    figures = RAMP_FIGURES(
        ramp_error_mean=(error, problem),
        ramp_error_rms=(rms, problem),
        ramp_slope=(slope, problem),
    )
    return (*_braking(run, options.M_high, options.t_hold), *figures)


def _followed(run: xr.Dataset, begin: float, end: float) -> tuple[float, float, float]:
    """Return mean and root mean square of the error [N m], and the moment's slope [N m/s]."""
    part = run.sel(time=slice(begin - 1e-9, end + 1e-9))
    error = (part["M_set"] - part["M_B"]).values
    slope = float(np.polyfit(part["time"].values, part["M_B"].values, 1)[0])
    return float(error.mean()), float(np.sqrt(np.mean(error**2))), slope


MOMENT_RAMP = Experiment(
    name="moment-ramp",
    assembly="wedge-brake",
    summary="moment step to {M_high}, reduction to {M_low}, slow ramp back (Fig. 8 of Roberts et "
    "al.)",
    options=RampOptions,
    defaults=RampOptions(
        M_high=200.0, M_low=160.0, t_hold=0.5, t_low=0.3, t_ramp=1.0, t_end=0.3, settle=0.05
    ),
    cases=ramp,
    judge=judge_ramp,
    kpis=BRAKING_FIGURES.units | RAMP_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)


# --- A pulse up to 950 N m and back to the parking position (Fig. 9)

LARGE_PULSE_FIGURES = Figures(
    peak_moment=("N*m", "Maximum moment."),
    peak_angle=("rad", "Maximum common reference of both motors, from the parking position."),
)


class LargePulseOptions(ParameterSet):
    """The braking maneuver."""

    M_high: SomeMoment
    """moment demand"""
    t_pulse: Duration
    """length of the pulse"""
    t_end: Duration
    """recording time after the pulse"""
    omega_gap: SpeedLimit
    """maximum speed during gap crossing, lower than in Figs. 7 and 8"""
    settle: Duration
    """time parked before the pulse"""


def large_pulse(
    par: WedgeParameters, options: LargePulseOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run."""
    levels = {0.0: options.M_high, options.t_pulse: 0.0}
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            options.t_pulse + options.t_end,
            {"control.moment.omega_gap": options.omega_gap},
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge_large_pulse(recordings: Recordings, options: LargePulseOptions) -> tuple[Kpi, ...]:
    """Return the key figures of the braking and the release."""
    run = along_disc(recordings["run"])
    return (
        *_braking(run, options.M_high, options.t_pulse),
        *LARGE_PULSE_FIGURES(
            peak_moment=run["M_B"].max(), peak_angle=np.abs(run["theta_ref"]).max()
        ),
        release_time(run, options.t_pulse),
        parking_time(run, options.t_pulse),
    )


MOMENT_PULSE_950 = Experiment(
    name="moment-pulse-950",
    assembly="wedge-brake",
    summary="moment pulse of {M_high} at the software rate limit (Fig. 9 of Roberts et al.)",
    options=LargePulseOptions,
    defaults=LargePulseOptions(M_high=950.0, t_pulse=0.2, t_end=0.3, omega_gap=60.0, settle=0.05),
    cases=large_pulse,
    judge=judge_large_pulse,
    kpis=BRAKING_FIGURES.units
    | LARGE_PULSE_FIGURES.units
    | {"release_time": "s", "parking_time": "s"},
    figures=("time-traces", "energy-balance"),
)
