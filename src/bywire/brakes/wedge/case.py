"""Shared parts of the wedge brake's experiments: parked starts, readings, figures of braking."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np
import xarray as xr
from pydantic import AfterValidator, Field

from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import Case
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import PARKED
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.quantities import Unit
from bywire.core.typing import Array

Signals = Mapping[str, Array]

BRAKING = Figures(
    contact_time=("s", "Time until the pads press on the disc."),
    time_to_90=("s", "Time until the moment sensor first shows 90 % of the demand."),
    peak_power=("W", "Largest power at the drives' input."),
    peak_power_filtered=("W", "Largest power at the drives' input, as the rig measures it."),
    peak_normal_force=("N", "Largest normal force."),
    caliper_energy=("J", "Largest energy of the caliper before the demand changes."),
    disc_share=("%", "Share of that energy supplied by the disc (self-reinforcement)."),
    rate_limited=("%", "Share of the time on the software rate limit, until the demand changes."),
    peak_speed=("rad/s", "Largest speed of motor 1."),
    energy_in=("J", "Energy at the drives' input, standby included."),
    energy_braked=("J", "Energy taken from the disc."),
    energy_left=("J", "Largest residual of the energy balance: the numerical error."),
    undefined="the signal does not reach the level in this time",
)
"""key figures of :func:`braking`"""


def case_from_parked(
    par: WedgeParameters,
    stimulus: Callable[[Array], Signals],
    duration: float,
    changes: Mapping[str, Any] | None = None,
    label: str = "run",
    **timing: float,
) -> Case:
    """Return the run of an experiment that starts parked, preloaded, without current.

    Parameters
    ----------
    changes
        Parameters that the experiment sets; the command mode is "moment" unless given.
    timing
        ``settle``, ``keep`` and ``record`` of the case [s].
    """
    changed = par.replace({"command.mode": "moment", **(changes or {})})
    return Case(
        label=label,
        model=WedgeBrake(),
        par=changed,
        state=state_at(0.0, changed),
        memory=memory_at(0.0, changed),
        stimulus=stimulus,
        duration=duration,
        start=lambda par: (state_at(0.0, par), memory_at(0.0, par)),
        **timing,
    )


def steps(t: Array, levels: Mapping[float, float]) -> Array:
    """Return a signal that takes each level from its time [s] on, and zero before the first."""
    y = np.zeros(t.shape)
    for begin, level in sorted(levels.items()):
        y = np.where(t >= begin - 1e-9, level, y)
    return y


def braking(run: xr.Dataset, target: float, end: float) -> tuple[Kpi, ...]:
    """Return the key figures of a braking that begins at time zero, in the disc's direction.

    ``target``: moment demanded [N m]; ``end``: time [s] at which the demand changes for the first
    time.
    """
    run = along_disc(run)
    after = run.sel(time=slice(-1e-9, None))
    held = run.sel(time=slice(-1e-9, end + 1e-9))
    peak = int(np.argmax(held["U_caliper"].values))
    stored = float(held["U_caliper"].values[peak])
    work = float(held["W_disc"].values[peak] - held["W_disc"].values[0])
    share = (
        (100.0 * work / stored, "") if stored > 0 else (math.nan, "the caliper stores no energy")
    )
    return BRAKING(
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
    """Return when the pads first press [s]; without clearance they touch from the start."""
    return 0.0 if parameters_of(held).caliper.clearance == 0.0 else first(held, "F_N", 0.0)


def parameters_of(run: xr.Dataset) -> WedgeParameters:
    """Return the parameters with which a recording was made."""
    par = getattr(run, "par", None)  # plain rows carry them
    if isinstance(par, WedgeParameters):
        return par
    return WedgeParameters.model_validate_json(run.attrs["parameters"])


def clearance(x: float, par: WedgeParameters) -> float:
    """Return the clearance of the pads [m] at a wedge travel [m], run-out left out."""
    return par.caliper.clearance - abs(x) * wedge.slope(par.wedge)


def release_time(run: xr.Dataset, begin: float, name: str = "release_time") -> Kpi:
    """Return the time from the end of the demand [s] until the pads finally leave the disc."""
    after = run.sel(time=slice(begin - 1e-9, None))
    pressing = np.flatnonzero(after["F_N"].values > 0)
    value, note = math.nan, ""
    if not after.sizes["time"]:
        note = "no row of the recording lies after the demand"
    elif not pressing.size:
        note = "the pads do not press when the demand falls"
    elif pressing[-1] + 1 == after.sizes["time"]:
        note = "the pads press until the end of the recording"
    else:
        value = float(after["time"].values[pressing[-1]]) - begin
    text = "Time from the end of the demand until the pads have left the disc."
    return Kpi(name, value, "s", text, note)


def parking_time(run: xr.Dataset, begin: float, name: str = "parking_time") -> Kpi:
    """Return the time from the end of the demand [s] until the brake is parked."""
    after = run.sel(time=slice(begin - 1e-9, None))
    parked = np.flatnonzero(after["mode"].values == PARKED)
    value, note = math.nan, "the brake is not parked when the recording ends"
    if parked.size:
        value, note = float(after["time"].values[parked[0]]) - begin, ""
    return Kpi(name, value, "s", "Time from the end of the demand until the brake is parked.", note)


def first(run: xr.Dataset, name: str, level: float) -> float:
    """Return when a signal first exceeds a level [s], interpolated; NaN where it never does."""
    t, y = run["time"].values, run[name].values
    above = np.flatnonzero(y > level)
    if above.size == 0:
        return math.nan
    k = int(above[0])
    if k == 0 or level == 0.0:
        return float(t[k])
    return float(t[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (t[k] - t[k - 1]))


def mean(run: xr.Dataset, name: str, begin: float, end: float) -> float:
    """Return the mean of a signal between two times [s]; NaN where no row lies there."""
    values = run[name].sel(time=slice(begin - 1e-9, end + 1e-9)).values
    return float(values.mean()) if values.size else math.nan


def swing(run: xr.Dataset, name: str, begin: float, end: float) -> float:
    """Return the peak-to-peak value of a signal between two times [s]; NaN where no row is."""
    values = run[name].sel(time=slice(begin - 1e-9, end + 1e-9)).values
    return float(np.ptp(values)) if values.size else math.nan


def _gained(run: xr.Dataset, name: str) -> float:
    return float(run[name].values[-1] - run[name].values[0])


# --- Reading recordings: the disc's direction, its revolutions, their rows


def along_disc(run: xr.Dataset) -> xr.Dataset:
    """Return a recording whose moments and speed count positive in the disc's first direction."""
    if not float(run["Omega"].values[0]) < 0:
        return run
    # Not negated, which would make negative zeros.
    return run.assign({name: 0.0 - run[name] for name in ("M_B", "y_M", "Omega")})


def last_turn(run: xr.Dataset, begin: float, end: float) -> float | None:
    """Return when the disc's last revolution before a time begins [s]; None if before another."""
    nearest = int(np.abs(run["time"].values - end).argmin())
    speed = abs(float(run["Omega"].values[nearest]))
    if speed * (end - begin) < 2.0 * math.pi:
        return None
    return end - 2.0 * math.pi / speed


def too_coarse(run: xr.Dataset, begin: float, end: float, rows: int = 1) -> str:
    """Return why rows are too far apart to judge a moment between two times [s]; else "".

    Parameters
    ----------
    rows
        Least number of rows in that time. A revolution of the disc takes five: fewer would
        alias the run-out's oscillation.
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
        f"rows {apart:.3g} s apart are too few between t = {begin:.4g} s and {end:.4g} s: "
        f"record every {interval:.2g} s or more often"
    )


# --- Several friction coefficients

FRICTIONLESS = {
    "bearing.C_0": 0.0,
    "bearing.C_1": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.law": "load",
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
    "encoder.law": "ideal",
}
"""changes that leave the pads on the disc as the brake's only dry friction; without friction the
counts of an encoder would keep the shafts moving"""


def _distinct(values: tuple[float, ...]) -> tuple[float, ...]:
    tags = [tag(value) for value in values]
    for k, value in enumerate(values):
        if tags[k] in tags[:k]:
            raise ValueError(f"{value:g} is given twice: leave one out")
    return values


Coefficient = Annotated[float, Field(gt=0, le=2, allow_inf_nan=False)]
Coefficients = Annotated[
    tuple[Coefficient, ...],
    Unit("1", 0.35),
    Field(min_length=1, max_length=100),
    AfterValidator(_distinct),
]
"""friction coefficients of the pads, in any order, each once"""


def tag(mu_B: float) -> str:
    """Return the name of a friction coefficient in labels and key figures.

    Examples
    --------
    >>> tag(0.35), tag(0.355)
    ('mu35', 'mu35p5')
    """
    return f"mu{100.0 * mu_B:.10g}".replace(".", "p")


def with_friction(par: WedgeParameters, mu_B: float, known: bool) -> dict[str, Any]:
    """Return the changes that give the pads a friction coefficient.

    Parameters
    ----------
    known
        Whether the moment controller knows the coefficient and assumes the slope that belongs to
        it. That slope keeps its ratio to the brake's, so that a mismatch remains.
    """
    slope = par.control.moment.slope_hat
    if known and par.wedge.mu_B > 0:
        slope *= mu_B / par.wedge.mu_B
    return {"wedge.mu_B": mu_B, "control.moment.slope_hat": slope}
