"""Drive trains of the wedge brake: demand, response, and comparison of many designs.

A design consists of a wedge slope and a screw lead. All other parameters follow from these two. The
reference speeds give every design the same response time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench.experiment import as_run
from bywire.brakes.wedge.case import case_from_parked, steps
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.model import force_for, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.quantities import Unit
from bywire.core.typing import Array
from bywire.plant import roller_screw
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run

Slope = Annotated[float, Unit("1", 0.3), Field(gt=0, le=2, allow_inf_nan=False)]
Count = Annotated[int, Unit("1", 11.0), Field(ge=3, le=101)]


_PHASES = tuple(0.5 * math.pi * k for k in range(4))
"""angles of the disc [rad] at which the runs start"""


@dataclass(frozen=True)
class Demand:
    """Demand on every design.

    Parameters
    ----------
    moment
        Step of the demand [N m].
    t_90
        Time [s] within which the sensor must show 90 % of it, at every friction coefficient.
    t_hold, t_release
        Lengths [s] of the demand and of the release after it.
    mu_B
        Friction coefficients of the pads.
    known
        Whether the moment control knows the coefficient, so that its crossover is unchanged.
    enforced
        Whether the speed of the reference enforces the time; otherwise the pads close as fast as
        with the given brake.
    whole
        Whether the power of the release also counts, or only that of build-up and hold.
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
    phases: Sequence[float] = _PHASES


@dataclass(frozen=True)
class Answer:
    """Response of a design, per friction coefficient, shape (cases,); the worst of all phases.

    The phase of the disc's run-out at the stop is random: the study tries several.

    Parameters
    ----------
    closing_speed
        Largest speed at which the reference closes the pads [m/s], the same for all cases.
    t_90
        Time to 90 % of the demand [s]; NaN if not reached.
    filtered, instantaneous
        Largest counted power at the drives' input [W], with and without the rig's filter.
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
_FASTEST = 8.0  # largest closing speed of the search, relative to the smallest
_ROUNDS, _TRIED = 2, 8  # rounds, and speeds tried in each between too slow and fast enough
_SETTLE, _RECORD, _STEP = 0.05, 2e-4, 20e-6
_LAST = 0.8  # share of the demand's length at which its final part begins
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

    The motion of the pads over time is unchanged: the speeds of the reference and the travel of the
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
    speeds = {f"control.moment.{name}": getattr(control, name) * ratio for name in _SPEEDS}
    if efficiency == "friction-angle":
        changes |= _efficiencies(par, lead)
    return par.replace(changes | speeds)


def _efficiencies(par: WedgeParameters, lead: float) -> dict[str, float]:
    r"""Return the efficiencies of a screw of another lead [m] with the same friction angle.

    With the lead angle :math:`\lambda` and the friction angle :math:`\rho`, both small, as in a
    screw that can be driven back:

    .. math::
        1/\eta_f - 1 = \tan(\lambda + \rho) / \tan\lambda - 1 \approx \rho / \lambda, \quad
        1 - \eta_b = 1 - \tan(\lambda - \rho) / \tan\lambda \approx \rho / \lambda

    so that both losses are proportional to 1/lead: the friction torque from the axial force is
    constant. A self-locking screw, with a small lead, has :math:`\eta_b = 0`.
    """
    ratio = par.screw.lead / lead
    eta_f = 1.0 / (1.0 + (1.0 / par.screw.eta_f - 1.0) * ratio)
    eta_b = 1.0 - (1.0 - par.screw.eta_b) * ratio
    return {"screw.eta_f": eta_f, "screw.eta_b": max(eta_b, 0.0)}


def answer(par: WedgeParameters, demand: Demand) -> Answer:
    """Return a brake's response at the smallest closing speed that is fast enough.

    The speeds of the reference have a common factor. With ``demand.enforced`` it is the smallest
    factor with which the slowest case meets the demanded time, within 1 %. If none does, it is the
    closest factor. Without ``demand.enforced`` it is 1.
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
    cases |= {f"control.moment.{name}": getattr(control, name) * factor for name in _SPEEDS}
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
        simulate_ensemble(_run(par, demand, phase, whole), cases, _SIGNALS, threads=1)
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
