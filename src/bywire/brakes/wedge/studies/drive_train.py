"""Drive train of the wedge brake: peak power versus wedge slope and screw lead at equal response.

A design consists of a wedge slope and a screw lead, which determine all other parameters. The
reference speeds give every design the same response time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bywire.bench.experiment import as_run
from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.wedge.case import Coefficients, case_from_parked, steps
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment, SpeedLimit
from bywire.brakes.wedge.model import force_for, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.interrupts import thread_pool
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Length, Unit
from bywire.core.typing import Array, Progress
from bywire.data.labeled import Labeled, labeled
from bywire.plant import roller_screw
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run
from bywire.synthesis.study import (
    Cut,
    Findings,
    Map,
    Mark,
    Study,
    edge_warnings,
    require_ranges,
    variable,
)

Slope = Annotated[float, Unit("1", 0.3), Field(gt=0, le=2, allow_inf_nan=False)]
Count = Annotated[int, Unit("1", 11.0), Field(ge=3, le=101)]


_PHASES = tuple(0.5 * math.pi * k for k in range(4))
"""disc angles [rad] at which the runs start"""


@dataclass(frozen=True)
class Demand:
    """Demand on every design.

    Parameters
    ----------
    moment
        Step of the demand [N m].
    t_90
        Time [s] within which the sensor must show 90 % of the step, at every friction coefficient.
    t_hold, t_release
        Lengths [s] of the demand and of the release after it.
    mu_B
        Pad friction coefficients.
    known
        Whether the moment control uses the true coefficient, which keeps its crossover constant.
    enforced
        Whether the speed of the reference enforces the time. Otherwise the pads close as fast as
        in the given brake.
    whole
        Whether the peak power includes the release, in addition to build-up and hold.
    phases
        Disc angles [rad] at which the runs begin.
    """

    moment: float
    t_90: float
    t_hold: float
    t_release: float
    mu_B: Sequence[float]
    known: bool
    enforced: bool
    whole: bool = False
    phases: Sequence[float] = _PHASES


@dataclass(frozen=True)
class Answer:
    """Response of a design at each friction coefficient, shape (cases,), worst of all phases.

    The phase of the disc runout at the stop is random, so the study tries several.

    Parameters
    ----------
    closing_speed
        Maximum speed at which the reference closes the pads [m/s], the same for all cases.
    t_90
        Time to 90 % of the demand [s], NaN if not reached.
    filtered, instantaneous
        Maximum counted power at the drives' input [W], with and without the rig's filter.
    release
        Maximum power during the release [W], with the rig's filter.
    current
        Maximum current demand of either motor [A].
    speed
        Maximum speed of either motor [rad/s].
    copper, friction
        Energies lost in copper, bearings and screws [J].
    held
        Mean moment in the last fifth of the stop [N m].
    left
        Moment at the end of the release [N m].
    stop
        Maximum force on the wedge's end stops [N].
    unsettled
        Substeps of all cases that hit the contact iteration's limit.
    """

    closing_speed: float
    t_90: Array
    filtered: Array
    instantaneous: Array
    release: Array
    current: Array
    speed: Array
    copper: Array
    friction: Array
    held: Array
    left: Array
    stop: Array
    unsettled: int


# --- One design

Efficiency = Literal["friction-angle", "as-given"]
"""screw property that stays constant as the lead varies: the friction angle, or the efficiency"""
_SPEEDS = ("omega_gap", "a_gap", "omega_creep", "rate_max")
"""parameters of the moment control that set the speed of the reference"""
_SIGNALS = (
    "y_M",
    "P_in",
    "P_meas",
    "i_1_ref",
    "i_2_ref",
    "F_end",
    "omega_1",
    "omega_2",
    "E_copper",
    "E_shaft",
)
_FASTEST = 8.0  # maximum closing speed of the search, relative to the minimum
_NARROWINGS, _TRIED = 2, 8  # rounds, and speeds per round between too slow and fast enough
_SETTLE, _RECORD, _STEP = 0.05, 2e-4, 20e-6
_LAST = 0.8  # fraction of the demand's length at which its final part begins
_TINY_MOMENT = 1e-9


def closing_speed(par: WedgeParameters) -> float:
    """Return the closing speed of the pads [m/s] at the rate limit of the reference."""
    travel = roller_screw.slope(par.screw) * wedge.slope(par.wedge)
    return par.control.moment.rate_max * travel


def redesigned(
    par: WedgeParameters,
    tan_alpha: float,
    lead: float,
    efficiency: Efficiency = "friction-angle",
) -> WedgeParameters:
    """Return the brake with another wedge slope and screw lead [m].

    The pads move in the same way over time. Therefore the speeds of the reference and the travel of
    the end stops change with the ratio of pad to shaft travel, and the controller uses the values
    of the design. The screw efficiency depends on the lead, or is ``"as-given"``.
    """
    travel = roller_screw.slope(par.screw) * wedge.slope(par.wedge)
    k = lead / (2.0 * math.pi)
    ratio = travel / (k * tan_alpha)
    control = par.control.moment
    changes = {
        "wedge.alpha": math.atan(tan_alpha),
        "wedge.x_stop": par.wedge.x_stop * wedge.slope(par.wedge) / tan_alpha,
        "screw.lead": lead,
        "control.offset.k_hat": par.control.offset.k_hat * k / roller_screw.slope(par.screw),
        "control.moment.slope_hat": control.slope_hat / ratio,
    }
    speeds = {f"control.moment.{name}": getattr(control, name) * ratio for name in _SPEEDS}
    if efficiency == "friction-angle":
        changes |= _efficiencies(par, lead)
    return par.replace(changes | speeds)


def _efficiencies(par: WedgeParameters, lead: float) -> dict[str, float]:
    r"""Return the efficiencies of a screw with another lead [m] and the same friction angle.

    With the lead angle :math:`\lambda` and the friction angle :math:`\rho`, both small, as in a
    back-drivable screw:

    .. math::
        1/\eta_f - 1 = \tan(\lambda + \rho) / \tan\lambda - 1 \approx \rho / \lambda, \quad
        1 - \eta_b = 1 - \tan(\lambda - \rho) / \tan\lambda \approx \rho / \lambda

    Both losses are proportional to 1/lead, because the friction torque from the axial force is
    constant. A self-locking screw, with a small lead, has :math:`\eta_b = 0`.
    """
    ratio = par.screw.lead / lead
    eta_f = 1.0 / (1.0 + (1.0 / par.screw.eta_f - 1.0) * ratio)
    eta_b = 1.0 - (1.0 - par.screw.eta_b) * ratio
    return {"screw.eta_f": eta_f, "screw.eta_b": max(eta_b, 0.0)}


def answer(par: WedgeParameters, demand: Demand) -> Answer:
    """Return a brake's response at the minimum closing speed that is fast enough.

    The speeds of the reference have a common factor. With ``demand.enforced`` it is the smallest
    factor at which the slowest case meets the demanded time, to within 1 %. If no factor meets it,
    the closest factor counts. Without ``demand.enforced`` the factor is 1.
    """
    controlled = par.replace({"command.mode": "moment"})
    if not demand.enforced:
        return _judged(controlled, demand, 1.0)
    # The pads must cover at least their travel in the demanded time.
    pads = [controlled.replace({"wedge.mu_B": mu_B}) for mu_B in demand.mu_B]
    F_N = 0.9 * max(force_for(demand.moment, brake) for brake in pads)
    least = travel_for(F_N, controlled) * wedge.slope(controlled.wedge) / demand.t_90
    # All speeds of a round run in parallel lanes, so eight cost little more than one.
    factors = least / closing_speed(controlled) * np.geomspace(1.0, _FASTEST, _TRIED)
    low = high = slow_time = fast_time = math.nan
    for _ in range(_NARROWINGS):
        times = _slowest(controlled, demand, factors)
        fast = np.flatnonzero(times <= demand.t_90)
        k = int(fast[0]) if fast.size else int(np.argmin(times))
        if k == 0 or not fast.size:
            return _judged(controlled, demand, float(factors[k]))
        low, high = float(factors[k - 1]), float(factors[k])
        slow_time, fast_time = float(times[k - 1]), float(times[k])
        factors = np.geomspace(low, high, _TRIED)
    share = 1.0
    if math.isfinite(slow_time):
        share = (slow_time - demand.t_90) / (slow_time - fast_time)
    return _judged(controlled, demand, low * (high / low) ** share)


def _run(par: WedgeParameters, demand: Demand, phase: float, duration: float) -> Run:
    """Return the stop with the disc at the angle ``phase`` [rad] when settling begins."""
    levels = {0.0: demand.moment, demand.t_hold: 0.0}
    case = case_from_parked(
        par, lambda t: {"M_set": steps(t, levels)}, duration, settle=_SETTLE, record=_RECORD
    )
    return as_run(replace(case, state=case.state._replace(phi=phase)), _STEP)


def _variations(par: WedgeParameters, demand: Demand, factors: Array) -> Mapping[str, Array]:
    """Return the parameters of all cases, which combine every coefficient with every factor."""
    mu, factor = (
        grid.ravel() for grid in np.meshgrid(np.asarray(demand.mu_B), factors, indexing="ij")
    )
    control = par.control.moment
    cases = {"wedge.mu_B": mu}
    cases |= {f"control.moment.{name}": getattr(control, name) * factor for name in _SPEEDS}
    if demand.known:
        cases["control.moment.slope_hat"] = control.slope_hat * mu / par.wedge.mu_B
    return cases


def _slowest(par: WedgeParameters, demand: Demand, factors: Array) -> Array:
    """Return the slowest case's time to 90 % [s] for each factor, infinite if not reached.

    Only the lowest and the highest friction coefficient are simulated.
    """
    demand = replace(demand, mu_B=(min(demand.mu_B), max(demand.mu_B)))
    cases, slowest = _variations(par, demand, factors), np.zeros(factors.size)
    for phase in demand.phases:
        run = _run(par, demand, phase, demand.t_hold)
        ensemble = simulate_ensemble(run, cases, ("y_M",), threads=1)
        times = _times(ensemble.time, ensemble["y_M"], 0.9 * demand.moment)
        times = np.where(np.isnan(times), math.inf, times)
        slowest = np.maximum(slowest, times.reshape(len(demand.mu_B), -1).max(axis=0))
    return slowest


def _judged(par: WedgeParameters, demand: Demand, factor: float) -> Answer:
    cases = _variations(par, demand, np.array([factor]))
    whole = demand.t_hold + demand.t_release
    runs = [
        simulate_ensemble(_run(par, demand, phase, whole), cases, _SIGNALS, threads=1)
        for phase in demand.phases
    ]
    time = runs[0].time - _SETTLE
    after, held = time >= -_TINY_MOMENT, time < demand.t_hold - _TINY_MOMENT
    counted = after if demand.whole else after & held

    def largest(rows: NDArray[np.bool_], *names: str) -> Array:
        sizes = [np.abs(run[name][:, rows]).max(axis=1) for run in runs for name in names]
        return np.asarray(np.max(sizes, axis=0))

    def gained(name: str) -> Array:
        rows = [run[name][:, after] for run in runs]
        return np.asarray(np.max([row[:, -1] - row[:, 0] for row in rows], axis=0))

    times = [_times(run.time, run["y_M"], 0.9 * demand.moment) for run in runs]
    at_end = held & (time >= _LAST * demand.t_hold)
    return Answer(
        closing_speed=factor * closing_speed(par),
        t_90=np.max(times, axis=0),
        filtered=largest(counted, "P_meas"),
        instantaneous=largest(counted, "P_in"),
        release=largest(~held, "P_meas"),
        current=largest(after, "i_1_ref", "i_2_ref"),
        speed=largest(after, "omega_1", "omega_2"),
        copper=gained("E_copper"),
        friction=gained("E_shaft"),
        held=np.min([run["y_M"][:, at_end].mean(axis=1) for run in runs], axis=0),
        left=np.max([np.abs(run["y_M"][:, -1]) for run in runs], axis=0),
        stop=largest(after, "F_end"),
        unsettled=sum(int(run.unsettled.sum()) for run in runs),
    )


def _times(time: Array, y: Array, level: float) -> Array:
    """Return the time [s after the demand] at which each row first exceeds a level, or NaN."""
    times = np.full(y.shape[0], math.nan)
    for n, row in enumerate(y):
        above = np.flatnonzero(row > level)
        if above.size and above[0] > 0:
            k = int(above[0])
            share = (level - row[k - 1]) / (row[k] - row[k - 1])
            times[n] = time[k - 1] + share * (time[k] - time[k - 1]) - _SETTLE
    return times


# --- The study

_ASSUMPTIONS = (
    "Wedge slope and screw lead vary. Motors, drives, bearings, stiffnesses, clearance and the "
    "screw travel for the preload are constant.",
    "The friction angle of the screws is constant. Their efficiency therefore increases with the "
    "lead, and a screw with a small lead is self-locking. With efficiency 'as-given' the "
    "efficiency is constant.",
    "The controllers use the design's travel per shaft angle and moment per angle.",
    "Equal response means that all speeds and accelerations of the reference are scaled so that "
    "the pads close equally fast. With response 'enforced', they have a common factor. It is the "
    "minimum factor at which the measured moment reaches 90 % of the demand in time at every "
    "friction coefficient.",
    "The bandwidths of the position loops on the shaft and the crossover of the moment loop are "
    "constant.",
    "The end stops of the wedge allow the same pad travel as before.",
    "A design is infeasible if at any coefficient it is more than 2 % late (with an enforced "
    "response), does not hold 95 % of the demand, does not release, or presses on an end stop.",
    "Power is the power at the drives' input, including standby, during build-up and hold, and "
    "optionally during the release.",
    "Each case runs with the disc at four angles, a quarter turn apart, and the worst result is "
    "used. "
    "The phase of the runout at the stop is random, and holding the moment against the runout "
    "needs power.",
)


class Options(ParameterSet):
    """The stop, the friction coefficients, and the designs to compare."""

    moment: SomeMoment
    """moment demand, applied as a single step"""
    t_90: Duration
    """time within which the measured moment must reach 90 %"""
    t_hold: Duration
    """duration of the moment demand"""
    t_release: Duration
    """time within which the brake must release after the demand"""
    counted: Literal["build-up-and-hold", "whole-pulse"]
    """whether the peak power includes the release"""
    omega_gap: SpeedLimit
    """maximum speed while crossing the gap with the given drive train; scales with all speeds"""
    mu_B: Coefficients
    """pad friction coefficients; the worst case determines the result"""
    believed: Literal["known", "as-given"]
    """whether the moment controller uses the true coefficients or the parameter set's"""
    response: Literal["enforced", "as-scaled"]
    """whether t_90 is enforced, or the pads close as fast as with the given drive train"""
    efficiency: Efficiency
    """screw property that stays constant as the lead varies: friction angle or efficiency"""
    power: Literal["filtered", "instantaneous"]
    """power to minimize, with the rig's filter or without it"""
    tan_alpha_min: Slope
    """minimum wedge slope"""
    tan_alpha_max: Slope
    """maximum wedge slope"""
    slopes: Count
    """number of slopes"""
    lead_min: Length
    """minimum screw lead"""
    lead_max: Length
    """maximum screw lead"""
    leads: Count
    """number of leads"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        slopes, leads = ("tan_alpha_min", "tan_alpha_max", "1"), ("lead_min", "lead_max", "m")
        require_ranges(self, (slopes, leads, ("t_90", "t_hold", "s")))
        return self


DEFAULTS = Options(
    moment=950.0,
    t_90=0.1,
    t_hold=0.2,
    t_release=0.2,
    counted="build-up-and-hold",
    omega_gap=60.0,
    mu_B=(0.25, 0.3, 0.35, 0.4, 0.45),
    believed="known",
    response="enforced",
    efficiency="friction-angle",
    power="filtered",
    tan_alpha_min=0.2,
    tan_alpha_max=0.45,
    slopes=11,
    lead_min=1e-3,
    lead_max=8e-3,
    leads=15,
)
"""pulse of Fig. 9 in Roberts et al. (2003), designs around the catalog's design"""

_NONE_FEASIBLE = "no design is feasible. Increase t_90 or t_hold, or compare other designs"
_NEAR = 1.05
"""designs within this factor of the minimum power are treated as equally good"""
_ROUNDS = 2  # rounds that refine the optimum; each halves the spacing
_TINY = 1e-6  # fraction of the spacing
_BORDER = 0.02  # contour between 0, feasible, and 1, close to the last feasible designs


class _Best(NamedTuple):
    """A design, and its maximum power [W] at the worst friction coefficient."""

    tan_alpha: float
    lead: float
    power: float
    at: xr.Dataset


def compute(par: WedgeParameters, options: Options, progress: Progress) -> Findings:
    """Return the map of peak power, the optimum from a finer grid, and the given design.

    Raises
    ------
    InputError
        If a design is not valid.
    """
    demand = Demand(
        options.moment,
        options.t_90,
        options.t_hold,
        options.t_release,
        options.mu_B,
        options.believed == "known",
        options.response == "enforced",
        options.counted == "whole-pulse",
    )
    par = par.replace({"control.moment.omega_gap": options.omega_gap})
    given = answer(par, demand)  # first and alone, because it also builds the kernels
    slopes = np.linspace(options.tan_alpha_min, options.tan_alpha_max, options.slopes)
    leads = np.linspace(options.lead_min, options.lead_max, options.leads)
    data = _mapped(par, demand, slopes, leads, partial(progress, "designs"), options.efficiency)
    warnings = _warnings(data)
    if data["infeasible"].values.all():
        warnings += (_NONE_FEASIBLE,)
        return Findings(data, _given(given, options), _ASSUMPTIONS, {}, (), warnings)
    coarse = _smallest(data, options.power)
    grids, best = [data], coarse
    for n in range(1, _ROUNDS + 1):
        near = (_around(slopes, best.tan_alpha, n), _around(leads, best.lead, n))
        report = partial(progress, f"optimum, round {n}")
        grids.append(_mapped(par, demand, *near, report, options.efficiency))
        best = min(best, _smallest(grids[-1], options.power), key=lambda design: design.power)
    here = Mark("given drive train", par.screw.lead, wedge.slope(par.wedge))
    marks = (Mark("optimum", best.lead, best.tan_alpha), here)
    maps = {
        kind: Map(
            f"worst_{kind}",
            "lead",
            "tan_alpha",
            f"Maximum {kind} power during the stop at the worst friction coefficient.",
            marks if kind == options.power else (here,),
            {"infeasible": ("infeasible", _BORDER)},
        )
        for kind in (options.power, _other(options.power))
    }
    kpis = (*_optimum(best, grids, options), *_given(given, options))
    limits = (*active(best.at, par, options), *around(grids, best.at, options))
    return Findings(
        data, kpis, _ASSUMPTIONS, maps, _cuts(data, best), warnings + _edges(best, options), limits
    )


def _smallest(data: xr.Dataset, power: str) -> _Best:
    """Return the feasible design with the least power. At least one must exist."""
    worst = data[f"worst_{power}"].values
    i, j = np.unravel_index(int(np.nanargmin(worst)), worst.shape)
    at = data.isel(tan_alpha=int(i), lead=int(j))
    return _Best(float(at["tan_alpha"]), float(at["lead"]), float(worst[i, j]), at)


def _around(nodes: Array, middle: float, halvings: int) -> Array:
    """Return up to five finer nodes around a value, within the range."""
    step = (nodes[1] - nodes[0]) / 2**halvings
    near = middle + step * np.arange(-2.0, 3.0)
    inside = (near >= nodes[0] - _TINY * step) & (near <= nodes[-1] + _TINY * step)
    return np.asarray(near[inside])


def _other(power: str) -> str:
    return "instantaneous" if power == "filtered" else "filtered"


def _optimum(best: _Best, grids: Sequence[xr.Dataset], options: Options) -> tuple[Kpi, ...]:
    other = _smallest(grids[0], _other(options.power))
    slopes, leads = [best.tan_alpha], [best.lead]
    for data in grids:
        good = np.argwhere(data[f"worst_{options.power}"].values <= _NEAR * best.power)
        slopes += [float(value) for value in data["tan_alpha"].values[good[:, 0]]]
        leads += [float(value) for value in data["lead"].values[good[:, 1]]]
    share = f"of designs within {100 * (_NEAR - 1):.0f} % of the minimum power"
    return (
        Kpi("optimum_tan_alpha", best.tan_alpha, "1", "Wedge slope with the lowest power."),
        Kpi("optimum_lead", best.lead, "m", "Screw lead with the lowest power."),
        Kpi(
            "optimum_power",
            best.power,
            "W",
            f"Maximum {options.power} power during the stop at the worst friction coefficient.",
        ),
        Kpi(
            "optimum_mu_B",
            float(best.at[f"mu_B_{options.power}"]),
            "1",
            "Friction coefficient that needs optimum_power.",
        ),
        Kpi(
            "optimum_release",
            float(best.at["release"].max()),
            "W",
            "Maximum filtered power during the optimum's release.",
        ),
        Kpi(
            "optimum_t_90",
            float(best.at["t_90"].max()),
            "s",
            "Time to 90 % of the demand at the slowest friction coefficient.",
        ),
        Kpi(
            "optimum_closing_speed",
            float(best.at["closing_speed"]),
            "m/s",
            "Maximum speed at which the optimum's reference closes the pads.",
        ),
        Kpi("optimum_current", float(best.at["current"].max()), "A", "Maximum current demand."),
        Kpi("flat_tan_alpha_min", min(slopes), "1", f"Minimum slope {share}."),
        Kpi("flat_tan_alpha_max", max(slopes), "1", f"Maximum slope {share}."),
        Kpi("flat_lead_min", min(leads), "m", f"Minimum lead {share}."),
        Kpi("flat_lead_max", max(leads), "m", f"Maximum lead {share}."),
        Kpi(
            "other_tan_alpha",
            other.tan_alpha,
            "1",
            f"Slope on the map with the lowest {_other(options.power)} power.",
        ),
        Kpi(
            "other_lead",
            other.lead,
            "m",
            f"Lead on the map with the lowest {_other(options.power)} power.",
        ),
        Kpi(
            "other_power",
            other.power,
            "W",
            f"Maximum {_other(options.power)} power there at the worst friction coefficient.",
        ),
    )


def _given(given: Answer, options: Options) -> tuple[Kpi, ...]:
    sizes = getattr(given, options.power)
    k, t_90 = int(np.argmax(sizes)), float(given.t_90.max())
    note = "" if math.isfinite(t_90) else "a case does not reach 90 %"
    return (
        Kpi(
            "given_power",
            float(sizes[k]),
            "W",
            f"Maximum {options.power} power of the given drive train at the worst coefficient.",
        ),
        Kpi(
            "given_mu_B",
            float(options.mu_B[k]),
            "1",
            "Friction coefficient that needs given_power.",
        ),
        Kpi(
            "given_release",
            float(given.release.max()),
            "W",
            "Maximum filtered power during the release of the given drive train.",
        ),
        Kpi(
            "given_t_90",
            t_90,
            "s",
            "Time to 90 % of the demand with the given drive train, slowest friction coefficient.",
            note,
        ),
        Kpi(
            "given_closing_speed",
            given.closing_speed,
            "m/s",
            "Maximum closing speed of the pads with the given drive train.",
        ),
    )


def _cuts(data: xr.Dataset, best: _Best) -> tuple[Cut, ...]:
    """Return the dependence on the lead at the map slope nearest to the optimum."""
    row = data.sel(tan_alpha=best.tan_alpha, method="nearest")
    worst = row[["release", "t_90", "current", "speed", "copper"]].max(dim="mu_B", keep_attrs=True)
    names = ("worst_filtered", "mu_B_filtered", "worst_instantaneous")
    shown = xr.merge([worst, row[list(names)]], compat="override")
    title = (
        f"tan(alpha) = {float(row['tan_alpha']):.3g}, worst friction coefficient; current, speed "
        "and copper loss over the whole pulse"
    )
    return (Cut(title, shown, ("lead", *names, *(str(name) for name in worst))),)


def _warnings(data: xr.Dataset) -> tuple[str, ...]:
    count = data.attrs["unsettled_substeps"]
    return (f"{count} substeps hit the contact iteration's limit",) if count else ()


def _edges(best: _Best, options: Options) -> tuple[str, ...]:
    """Return a warning if the optimum is at the edge of the design range."""
    slopes = (options.tan_alpha_min, options.tan_alpha_max)
    leads = (options.lead_min, options.lead_max)
    return (
        *edge_warnings("tan_alpha", best.tan_alpha, slopes, "1"),
        *edge_warnings("lead", best.lead, leads, "m"),
    )


# --- Many drive trains as a dataset

_LATE = 1.02
"""ratio to the demanded time up to which a design is treated as equally fast"""


_HELD = 0.95
"""fraction of the demand above which the demand is treated as held"""


_LEFT = 0.05
"""fraction of the demand below which the brake is treated as released"""


_NEVER = 10.0  # lateness if the moment is never reached


_PER_CASE = {
    "t_90": ("s", "time to 90 % of the demand"),
    "filtered": ("W", "maximum power, filtered"),
    "instantaneous": ("W", "maximum power"),
    "release": ("W", "maximum power during the release, filtered"),
    "current": ("A", "maximum current demand"),
    "speed": ("rad/s", "maximum motor speed"),
    "copper": ("J", "copper loss"),
    "friction": ("J", "friction of bearings and screws"),
    "held": ("N*m", "mean moment at the end of the stop"),
    "left": ("N*m", "residual moment at the end"),
    "stop": ("N", "force on the end stops"),
}


def _mapped(
    par: WedgeParameters,
    demand: Demand,
    slopes: Array,
    leads: Array,
    progress: Callable[[float], None],
    efficiency: Efficiency,
) -> xr.Dataset:
    """Return the responses of all designs on a grid, computed on all cores. Can be interrupted.

    ``slopes``, ``leads``: wedge slopes, shape (n,), and screw leads [m], shape (m,); ``progress``:
    called with the finished fraction, 0 to 1; ``efficiency``: see `redesigned`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``tan_alpha``, ``lead`` and ``mu_B``. Each case has the fields of `Answer`. Each
        design has ``closing_speed``, ``lateness`` (ratio of the slowest time to the demanded one),
        ``infeasible`` (0 or 1), ``worst_filtered`` and ``worst_instantaneous`` (NaN if
        infeasible), and ``mu_B_filtered`` and ``mu_B_instantaneous``, the coefficients at which
        they occur.
    """
    designs = [(float(a), float(b)) for a in slopes for b in leads]
    answers: list[Answer] = []
    with thread_pool() as pool:
        every = pool.map(
            lambda design: answer(redesigned(par, design[0], design[1], efficiency), demand),
            designs,
        )
        for k, judged in enumerate(every):
            answers.append(judged)
            progress((k + 1) / len(designs))
    axes = {
        "tan_alpha": (slopes, "1", "wedge slope"),
        "lead": (leads, "m", "screw lead"),
        "mu_B": (np.asarray(demand.mu_B), "1", "pad friction coefficient"),
    }
    return _dataset(answers, demand, axes)


def _dataset(answers: Sequence[Answer], demand: Demand, axes: Mapping[str, Labeled]) -> xr.Dataset:
    plane, shape = ("tan_alpha", "lead"), [len(each[0]) for each in axes.values()]
    cases = {
        name: np.array([getattr(each, name) for each in answers]).reshape(shape)
        for name in _PER_CASE
    }
    data = labeled(axes, {name: (cases[name], *_PER_CASE[name]) for name in _PER_CASE})
    slowest = cases["t_90"].max(axis=2)  # NaN if one case does not reach 90 %
    lateness = np.where(np.isnan(slowest), _NEVER, slowest / demand.t_90)
    in_time = (lateness <= _LATE) if demand.enforced else (lateness < _NEVER)
    holds = cases["held"].min(axis=2) >= _HELD * demand.moment
    released = cases["left"].max(axis=2) <= _LEFT * demand.moment
    feasible = in_time & holds & released & (cases["stop"].max(axis=2) == 0.0)
    speeds = np.array([each.closing_speed for each in answers]).reshape(shape[:2])
    data["closing_speed"] = variable(speeds, plane, "m/s", "closing speed of the pads")
    data["lateness"] = variable(lateness, plane, "1", "ratio of slowest time to demanded time")
    data["infeasible"] = variable(1.0 - feasible, plane, "1", "late, not held, or at a stop")
    for name in ("filtered", "instantaneous"):
        worst = np.where(feasible, cases[name].max(axis=2), np.nan)
        mu_B = np.asarray(demand.mu_B)[cases[name].argmax(axis=2)]
        label = f"maximum {name} power, worst mu_B"
        data[f"worst_{name}"] = variable(worst, plane, "W", label)
        data[f"mu_B_{name}"] = variable(mu_B, plane, "1", "worst friction coefficient")
    data.attrs["unsettled_substeps"] = sum(each.unsettled for each in answers)
    return data


# --- Limits of a drive train: active constraints, and failures or power of its neighbors

_AT = 0.99  # fraction of a limit above which the limit is treated as reached


def active(at: xr.Dataset, par: WedgeParameters, options: Options) -> list[str]:
    """Return the active constraints of a design.

    Parameters
    ----------
    at
        The design, with variables over ``mu_B`` and scalars.
    par
        The given brake.
    options
        Options of the study.
    """
    texts = []
    if options.response == "enforced" and float(at["lateness"]) >= _AT:
        texts.append(
            f"time: {float(at['t_90'].max()) * 1e3:.4g} ms of the demanded "
            f"{options.t_90 * 1e3:.4g} ms, slowest at mu_B = {_where(at['t_90']):g}"
        )
    limits = {"control.position.i_max": par.control.position.i_max, "drive.i_max": par.drive.i_max}
    name, i_max = min(limits.items(), key=lambda limit: limit[1])
    if float(at["current"].max()) >= _AT * i_max:
        reached = at["mu_B"].values[at["current"].values >= _AT * i_max]
        texts.append(f"current: at the limit {name} = {i_max:g} A with mu_B = {_listed(reached)}")
    held = at["held"].min() / options.moment
    if float(held) < _HELD / _AT:
        texts.append(
            f"hold: {100.0 * float(held):.3g} % of the demand is held in the worst case, "
            f"mu_B = {_where(-at['held']):g}"
        )
    if float(at["left"].max()) > _AT * _LEFT * options.moment:
        texts.append(f"release: {float(at['left'].max()):.3g} N·m remain at the end")
    powers = at[options.power]
    near = at["mu_B"].values[powers.values >= _AT * float(powers.max())]
    texts.append(f"power: {float(powers.max()):.3g} W at mu_B = {_listed(near)}")
    return texts


def failures(at: xr.Dataset, options: Options) -> list[str]:
    """Return the reasons why a design is infeasible, empty if it is feasible."""
    reasons = []
    slowest = float(at["t_90"].max(skipna=False))
    if math.isnan(slowest):
        reasons.append("never reaches 90 % of the demand")
    elif options.response == "enforced" and float(at["lateness"]) > _LATE:
        reasons.append(f"late, {slowest * 1e3:.4g} ms at mu_B = {_where(at['t_90']):g}")
    if float(at["held"].min()) < _HELD * options.moment:
        reasons.append("does not hold the demand")
    if float(at["left"].max()) > _LEFT * options.moment:
        reasons.append("does not release")
    if float(at["stop"].max()) > 0.0:
        reasons.append("presses on an end stop")
    return reasons


def around(grids: Sequence[xr.Dataset], best: xr.Dataset, options: Options) -> list[str]:
    """Return the neighbors of the best design, on the finest grid that contains it.

    ``grids``: maps of designs, coarse to fine; ``best``: the best design.
    """
    tan_alpha, lead = float(best["tan_alpha"]), float(best["lead"])
    power, texts = float(best[f"worst_{options.power}"]), []
    grid = [g for g in grids if tan_alpha in g["tan_alpha"].values and lead in g["lead"].values][-1]
    i, j = (
        int(np.flatnonzero(grid[name].values == value)[0])
        for name, value in (("tan_alpha", tan_alpha), ("lead", lead))
    )
    steps = {
        "flatter wedge": (-1, 0),
        "steeper wedge": (1, 0),
        "shorter lead": (0, -1),
        "longer lead": (0, 1),
    }
    for label, (di, dj) in steps.items():
        k, m = i + di, j + dj
        if not (0 <= k < grid.sizes["tan_alpha"] and 0 <= m < grid.sizes["lead"]):
            continue
        neighbor = grid.isel(tan_alpha=k, lead=m)
        value = (
            f"tan(alpha) = {float(neighbor['tan_alpha']):.4g}"
            if di
            else f"lead = {1e3 * float(neighbor['lead']):.4g} mm"
        )
        reasons = failures(neighbor, options)
        more = 100.0 * (float(neighbor[options.power].max()) / power - 1.0)
        outcome = f"{more:+.2g} % power, at mu_B = {_where(neighbor[options.power]):g}"
        if reasons:
            outcome = f"infeasible: {'; '.join(reasons)}"
        texts.append(f"{label}, {value}: {outcome}")
    return texts


def _where(values: xr.DataArray) -> float:
    return float(values["mu_B"].values[np.argmax(values.values)])


def _listed(values: Array) -> str:
    return ", ".join(f"{float(value):g}" for value in values)


STUDY = Study(
    name="drive-train",
    assembly="wedge-brake",
    summary="peak power of a hard stop versus wedge slope and screw lead, at equal response",
    options=Options,
    defaults=DEFAULTS,
    compute=compute,
    ruled={
        "wedge.mu_B": "set the study's option mu_B, for example mu_B=0.3,0.5",
        "control.moment.omega_gap": "set the study's option omega_gap",
        "command.mode": "the study demands moments",
        "rig": "only the rigs use it",
    },
)
