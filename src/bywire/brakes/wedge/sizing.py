"""Drive trains of the wedge brake: demand, response, and comparison of many designs.

A design is a slope of the wedge and a lead of the screws. All other
parameters follow from them. The speeds of the reference make every design respond equally fast.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.wedge.case import case_from_parked, steps
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.model import force_for, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.interrupts import thread_pool
from bywire.core.quantities import Unit
from bywire.core.typing import Array
from bywire.data.labeled import Labeled, labeled
from bywire.plant import roller_screw
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run
from bywire.synthesis.study import variable

Slope = Annotated[float, Unit("1", 0.3), Field(gt=0, le=2, allow_inf_nan=False)]
Count = Annotated[int, Unit("1", 11.0), Field(ge=3, le=101)]


PHASES = tuple(0.5 * math.pi * k for k in range(4))
"""angles of the disc [rad] at which a run begins"""


@dataclass(frozen=True)
class Demand:
    """Demand on every design.

    Parameters
    ----------
    moment
        Step of the demand [N m].
    t_90
        Time [s] in which the sensor must show 90 % of it, at every friction coefficient.
    t_hold, t_release
        Lengths [s] of the demand and of the release after it.
    mu_B
        Friction coefficients of the pads.
    known
        Whether the moment control knows the coefficient, so that its crossover is unchanged.
    enforced
        Whether the speed of the reference enforces the time; otherwise the pads' closing speed is
        that of the given brake.
    whole
        Whether the power of the release counts too, or that of build-up and hold alone.
    phases
        Angles of the disc [rad] at which the runs begin.
    """

    moment: float
    t_90: float
    t_hold: float
    t_release: float
    mu_B: Sequence[float]
    known: bool
    enforced: bool
    whole: bool = False
    phases: Sequence[float] = PHASES


@dataclass(frozen=True)
class Answer:
    """Response of a design, per friction coefficient, shape (cases,); the worst of all phases.

    The phase of the disc's run-out at the stop is chance: the study tries several.

    Parameters
    ----------
    closing_speed
        Largest speed at which the reference closes the pads [m/s], the same for all cases.
    t_90
        Time to 90 % of the demand [s]; NaN where it is not reached.
    filtered, instantaneous
        Largest power at the drives' input [W], with and without the rig's filter, where it counts.
    release
        Largest power during the release [W], with the rig's filter.
    current
        Largest current demand of either motor [A].
    speed
        Largest speed of either motor [rad/s].
    copper, friction
        Energies lost in copper, bearings and screws [J].
    held
        Mean moment in the last fifth of the stop [N m].
    left
        Moment at the end of the release [N m].
    stop
        Largest force on the wedge's end stops [N].
    unsettled
        Substeps of all cases that hit the cap of the contact iteration.
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
"""constant property of the screw over the lead: the friction angle, or the efficiency"""
SPEEDS = ("omega_gap", "a_gap", "omega_creep", "rate_max")
"""parameters of the moment control that set how fast the reference moves"""
SIGNALS = (
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
_FASTEST = 8.0  # largest closing speed of the search, over the least
_ROUNDS, _TRIED = 2, 8  # rounds, and speeds tried in each between too slow and fast enough
_SETTLE, _RECORD, _STEP = 0.05, 2e-4, 20e-6
_LAST = 0.8  # share of the demand's time after which its end begins
_TINY = 1e-9


def closing_speed(par: WedgeParameters) -> float:
    """Return the speed [m/s] at which the pads close at the rate limit of the reference."""
    travel = roller_screw.slope(par.screw) * wedge.slope(par.wedge)
    return par.control.moment.rate_max * travel


def redesigned(
    par: WedgeParameters,
    tan_alpha: float,
    lead: float,
    efficiency: Efficiency = "friction-angle",
) -> WedgeParameters:
    """Return the brake with another wedge slope and screw lead [m].

    The pads move as before for the same time: the speeds of the reference and the travel of the
    end stops change with the ratio of pad to shaft travel, and the controller knows the design.
    The screw's efficiency follows the lead, see `efficiencies`, or is ``"as-given"``.
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
    speeds = {f"control.moment.{name}": getattr(control, name) * ratio for name in SPEEDS}
    if efficiency == "friction-angle":
        changes |= efficiencies(par, lead)
    return par.replace(changes | speeds)


def efficiencies(par: WedgeParameters, lead: float) -> dict[str, float]:
    r"""Return the efficiencies of a screw of another lead [m] with the same friction angle.

    With the lead angle :math:`\lambda` and the friction angle :math:`\rho`, both small, as in a
    screw that can be driven back:

    .. math::
        1/\eta_f - 1 = \tan(\lambda + \rho) / \tan\lambda - 1 \approx \rho / \lambda, \quad
        1 - \eta_b = 1 - \tan(\lambda - \rho) / \tan\lambda \approx \rho / \lambda

    so that both losses fall with 1/lead: the friction torque by the axial force is constant. A
    self-locking screw, of a small lead, has :math:`\eta_b = 0`.
    """
    ratio = par.screw.lead / lead
    eta_f = 1.0 / (1.0 + (1.0 / par.screw.eta_f - 1.0) * ratio)
    eta_b = 1.0 - (1.0 - par.screw.eta_b) * ratio
    return {"screw.eta_f": eta_f, "screw.eta_b": max(eta_b, 0.0)}


def answer(par: WedgeParameters, demand: Demand) -> Answer:
    """Return a brake's response at the smallest closing speed that is fast enough.

    The speeds of the reference have a common factor. With ``demand.enforced`` it is the smallest
    factor with which the slowest case meets the demanded time, within 1 %. If no factor does, it
    is the one that comes closest. Otherwise it is 1.
    """
    controlled = par.replace({"command.mode": "moment"})
    if not demand.enforced:
        return _judged(controlled, demand, 1.0)
    # The pads must at least cover their travel in the demanded time.
    pads = [controlled.replace({"wedge.mu_B": mu_B}) for mu_B in demand.mu_B]
    F_N = 0.9 * max(force_for(demand.moment, brake) for brake in pads)
    least = travel_for(F_N, controlled) * wedge.slope(controlled.wedge) / demand.t_90
    # All speeds of a round run in parallel lanes: eight cost little more than one.
    factors = least / closing_speed(controlled) * np.geomspace(1.0, _FASTEST, _TRIED)
    low = high = slow_time = fast_time = math.nan
    for _ in range(_ROUNDS):
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
    """Return the stop with the disc at an angle [rad] when the settling begins."""
    levels = {0.0: demand.moment, demand.t_hold: 0.0}
    case = case_from_parked(
        par, lambda t: {"M_set": steps(t, levels)}, duration, settle=_SETTLE, record=_RECORD
    )
    return as_run(replace(case, state=case.state._replace(phi=phase)), _STEP)


def _variations(par: WedgeParameters, demand: Demand, factors: Array) -> Mapping[str, Array]:
    """Return the parameters of all cases: every friction coefficient with every factor."""
    mu, factor = (
        grid.ravel() for grid in np.meshgrid(np.asarray(demand.mu_B), factors, indexing="ij")
    )
    control = par.control.moment
    cases = {"wedge.mu_B": mu}
    cases |= {f"control.moment.{name}": getattr(control, name) * factor for name in SPEEDS}
    if demand.known:
        cases["control.moment.slope_hat"] = control.slope_hat * mu / par.wedge.mu_B
    return cases


def _slowest(par: WedgeParameters, demand: Demand, factors: Array) -> Array:
    """Return the time to 90 % of the slowest case [s] for every factor; infinite if not reached.

    Only the smallest and the largest friction coefficient are simulated.
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
        simulate_ensemble(_run(par, demand, phase, whole), cases, SIGNALS, threads=1)
        for phase in demand.phases
    ]
    time = runs[0].time - _SETTLE
    after, held = time >= -_TINY, time < demand.t_hold - _TINY
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
    """Return when each row first exceeds a level [s after the demand], interpolated, or NaN."""
    times = np.full(y.shape[0], math.nan)
    for n, row in enumerate(y):
        above = np.flatnonzero(row > level)
        if above.size and above[0] > 0:
            k = int(above[0])
            share = (level - row[k - 1]) / (row[k] - row[k - 1])
            times[n] = time[k - 1] + share * (time[k] - time[k - 1]) - _SETTLE
    return times


# --- Many drive trains as a dataset

LATE = 1.02
"""share of the demanded time up to which a design answers equally fast"""
HELD = 0.95
"""share of the demand that counts as held"""
LEFT = 0.05
"""share of the demand below which the brake counts as released"""
_NEVER = 10.0  # lateness of a moment that is never reached

_PER_CASE = {
    "t_90": ("s", "time to 90 % of the demand"),
    "filtered": ("W", "largest power, filtered"),
    "instantaneous": ("W", "largest power"),
    "release": ("W", "largest power of the release, filtered"),
    "current": ("A", "largest current demand"),
    "speed": ("rad/s", "largest motor speed"),
    "copper": ("J", "copper loss"),
    "friction": ("J", "friction of bearings and screws"),
    "held": ("N*m", "mean moment at the end of the stop"),
    "left": ("N*m", "moment left at the end"),
    "stop": ("N", "force on the end stops"),
}


def mapped(
    par: WedgeParameters,
    demand: Demand,
    slopes: Array,
    leads: Array,
    progress: Callable[[float], None] = lambda share: None,
    efficiency: Efficiency = "friction-angle",
) -> xr.Dataset:
    """Return the responses of all designs on a grid, computed on all cores; can be interrupted.

    ``slopes``, ``leads``: slopes of the wedge, shape (n,), and leads of the screws [m], shape (m,);
    ``progress``: called with the finished share, 0 to 1; ``efficiency``: see `redesigned`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``tan_alpha``, ``lead`` and ``mu_B``. Per case the fields of `Answer`; per
        design ``closing_speed``, ``lateness`` (slowest time over the demanded one), ``infeasible``
        (0 or 1), and ``worst_filtered`` and ``worst_instantaneous``, NaN where infeasible, with
        ``mu_B_filtered`` and ``mu_B_instantaneous``, where each occurs.
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
        "tan_alpha": (slopes, "1", "slope of the wedge"),
        "lead": (leads, "m", "lead of the screws"),
        "mu_B": (np.asarray(demand.mu_B), "1", "friction coefficient of the pads"),
    }
    return _dataset(answers, demand, axes)


def _dataset(answers: Sequence[Answer], demand: Demand, axes: Mapping[str, Labeled]) -> xr.Dataset:
    plane, shape = ("tan_alpha", "lead"), [len(each[0]) for each in axes.values()]
    cases = {
        name: np.array([getattr(each, name) for each in answers]).reshape(shape)
        for name in _PER_CASE
    }
    data = labeled(axes, {name: (cases[name], *_PER_CASE[name]) for name in _PER_CASE})
    slowest = cases["t_90"].max(axis=2)  # NaN where one case does not reach it
    lateness = np.where(np.isnan(slowest), _NEVER, slowest / demand.t_90)
    in_time = (lateness <= LATE) if demand.enforced else (lateness < _NEVER)
    holds = cases["held"].min(axis=2) >= HELD * demand.moment
    released = cases["left"].max(axis=2) <= LEFT * demand.moment
    feasible = in_time & holds & released & (cases["stop"].max(axis=2) == 0.0)
    speeds = np.array([each.closing_speed for each in answers]).reshape(shape[:2])
    data["closing_speed"] = variable(speeds, plane, "m/s", "closing speed of the pads")
    data["lateness"] = variable(lateness, plane, "1", "slowest time over the demanded time")
    data["infeasible"] = variable(1.0 - feasible, plane, "1", "late, not held, or at a stop")
    for name in ("filtered", "instantaneous"):
        worst = np.where(feasible, cases[name].max(axis=2), np.nan)
        mu_B = np.asarray(demand.mu_B)[cases[name].argmax(axis=2)]
        label = f"largest {name} power, worst mu_B"
        data[f"worst_{name}"] = variable(worst, plane, "W", label)
        data[f"mu_B_{name}"] = variable(mu_B, plane, "1", "worst friction coefficient")
    data.attrs["unsettled_substeps"] = sum(each.unsettled for each in answers)
    return data
