"""Run of a procedure: stop after stop, each with the heat of the stops before it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bywire.bench import running
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict, status_of, verdict_of
from bywire.bench.running import Result
from bywire.core.errors import ParameterError, RunError, quoted
from bywire.core.typing import Array, Progress, silent
from bywire.core.units import shown
from bywire.plant import disc_heat
from bywire.procedures.cooling import cooled
from bywire.procedures.motion import Motion, StopBench
from bywire.procedures.procedure_file import ProcedurePlan, StopPlan

Heat = Mapping[str, disc_heat.State]
"""temperatures of the brakes by part"""
_ADJUSTMENTS = 20  # maximum number of runs that adjust the demand
_CLOSE = 1e-3  # maximum relative deviation from the required deceleration
_ROWS = 30  # of an interval
NOT_SHOWN = "not shown"
"""outcome of a limit for which a number is missing"""


@dataclass(frozen=True)
class NotShown:
    """Limit that a procedure cannot judge.

    Parameters
    ----------
    figure, limit
        Name of the figure, and the text of the limit.
    reason
        Reason, for example the missing number.
    """

    figure: str
    limit: str
    reason: str

    @property
    def outcome(self) -> str:
        """The outcome ``not shown``."""
        return NOT_SHOWN


@dataclass(frozen=True)
class Stop:
    """One stop of a procedure, or several that are identical.

    Parameters
    ----------
    plan
        Its conditions.
    first, count
        Number of the first stop under these conditions, and number of identical stops.
    kpis
        Key figures.
    verdicts
        Verdicts on the limits.
    gaps
        Limits without a verdict.
    warnings
        Warnings of the run.
    begin
        Time at which the stop begins [s], measured from the first stop whose heat affects it.
    course
        Times from then on [s], speeds [m/s] and disc temperatures [K] by name, until the stop ends.
    pause
        Times [s] and disc temperatures [K] of the interval before the stop; empty without one.
    """

    plan: StopPlan
    first: int
    count: int
    kpis: tuple[Kpi, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    gaps: tuple[NotShown, ...] = ()
    warnings: tuple[str, ...] = ()
    begin: float = 0.0
    course: Mapping[str, Array] = field(default_factory=dict, repr=False)
    pause: Mapping[str, Array] = field(default_factory=dict, repr=False)

    def kpi(self, name: str) -> Kpi | None:
        """Return a key figure by name; None if the stop was not run or has no such figure."""
        return next((each for each in self.kpis if each.name == name), None)


@dataclass(frozen=True)
class Procedure:
    """Result of a procedure.

    Parameters
    ----------
    plan
        The procedure.
    stops
        Its stops in order.
    """

    plan: ProcedurePlan
    stops: tuple[Stop, ...]

    @property
    def verdicts(self) -> list[Verdict]:
        """All verdicts."""
        return [verdict for stop in self.stops for verdict in stop.verdicts]

    @property
    def gaps(self) -> list[NotShown]:
        """All limits without a verdict."""
        return [gap for stop in self.stops for gap in stop.gaps]

    @property
    def status(self) -> str:
        """``failed``, ``undecided``, ``incomplete`` (a limit has no verdict) or ``passed``."""
        status = status_of(self.verdicts)
        return "incomplete" if self.gaps and status in ("passed", "done") else status


@dataclass
class _Thread:
    """State of a procedure between two stops.

    Parameters
    ----------
    heat
        Temperatures at the end of the last stop; None if no stop came before.
    begin, length
        Beginning and duration of the last stop [s].
    is_known
        Whether the temperatures are known, because no earlier stop was left out.
    """

    heat: Heat | None = None
    begin: float = 0.0
    length: float = 0.0
    is_known: bool = True


def run_stops(
    plan: ProcedurePlan, progress: Progress = silent, *, estimate_error: bool = True
) -> Procedure:
    """Run the stops of a procedure in order, and judge them.

    Parameters
    ----------
    plan
        The procedure.
    progress
        Called with the name of a stop and the completed fraction of the procedure, 0 to 1.
    estimate_error
        Whether to estimate the numerical errors of key figures by runs with other steps.

    Raises
    ------
    InputError
        If an interval is shorter than a stop, or a stop cannot be set up.
    RunError
        If a run fails, or a demand does not reach the required deceleration.
    KeyboardInterrupt
        If interrupted.
    """
    stops: list[Stop] = []
    state = _Thread()
    total = sum(each.count for each in plan.stops)
    done = 0
    for each in plan.stops:
        if each.bench is None:
            stops.append(_left_out(each, f"missing: {', '.join(each.lacking)}"))
            state.is_known = False
        elif each.follows and not state.is_known:
            reason = "an earlier stop was not run, so the brake temperature is unknown"
            stops.append(_left_out(each, reason))
        else:
            stops += _Stops(plan, each, stops, estimate_error).run(state, progress, done, total)
        done += each.count
        progress(each.name, done / total)
    return Procedure(plan, tuple(stops))


def _run(bench: StopBench, estimate_error: bool = False) -> Result:
    result = running.run(bench, estimate_error=estimate_error)
    if result.status == "interrupted":
        raise KeyboardInterrupt
    return result


def _left_out(plan: StopPlan, reason: str) -> Stop:
    gaps = [NotShown(figure, text, reason) for figure, text, _ in plan.unknown]
    gaps += [NotShown(limit.figure, limit.text, reason) for limit in plan.limits]
    return Stop(plan, 1, plan.count, gaps=tuple(gaps))


@dataclass(frozen=True)
class _Stops:
    """Runner of the stops under the same conditions."""

    whole: ProcedurePlan
    plan: StopPlan
    before: Sequence[Stop]
    estimate_error: bool

    def run(self, state: _Thread, progress: Progress, done: int, total: int) -> list[Stop]:
        """Return the stops, and update the state."""
        plan, made = self.plan, []
        scale, adjusted = 1.0, None
        repeats = 1 if plan.interval is None else plan.count
        for k in range(repeats):
            heat, begin, pause = self._start(state, k)
            if plan.deceleration is not None and (k == 0 or plan.adjusts_every):
                scale, adjusted = self._adjusted(heat, scale, k)
            stop, left, length = self._stop(heat, begin, scale, k, adjusted)
            adjusted = None
            made.append(replace(stop, pause=pause))
            state.heat, state.begin, state.length = left, begin, length
            state.is_known = left is not None
            if left is None and k + 1 < repeats:
                why = f"stop {k + 1} does not end, so the brake temperature is unknown"
                rest = _left_out(plan, why)
                made.append(replace(rest, first=k + 2, count=plan.count - k - 1))
                break
            progress(plan.name, (done + k + 1) / total)
        if repeats < plan.count:
            made = [replace(made[0], count=plan.count)]
        return made

    @property
    def _motion(self) -> Motion:
        assert self.plan.motion is not None
        return self.plan.motion

    def _start(self, state: _Thread, k: int) -> tuple[Heat, float, Mapping[str, Array]]:
        """Return the temperatures and the time at the start of a stop, and the interval before."""
        plan = self.plan
        assert plan.bench is not None
        laws = self._motion.laws(plan.bench.par)
        air = {name: disc_heat.State(law.T_a, law.T_a, law.T_a) for name, law in laws.items()}
        if plan.T_brake is not None and (k == 0 or plan.interval is None):
            warm = {name: each._replace(T_disc=plan.T_brake) for name, each in air.items()}
            return warm, 0.0, {}
        if plan.interval is None or state.heat is None:
            return air, 0.0, {}
        pause = plan.interval - state.length
        if not pause > 0.0:
            raise ParameterError(
                f"[[stops]] {quoted(plan.name)} interval = {shown(plan.interval, 's')} is not "
                f"valid: it must be > {shown(state.length, 's')}, the previous stop's duration",
                name="interval",
                value=shown(plan.interval, "s"),
                valid=f"> {shown(state.length, 's')}",
            )
        t = np.linspace(0.0, pause, _ROWS)
        courses = {
            name: cooled(state.heat[name], law, plan.cooling_speed, t) for name, law in laws.items()
        }
        heat = {
            name: disc_heat.State(**{key: float(T[-1]) for key, T in each.items()})
            for name, each in courses.items()
        }
        discs = {self._disc(name): each["T_disc"] for name, each in courses.items()}
        begin = state.begin + plan.interval
        return heat, begin, {"time": state.begin + state.length + t, **discs}

    def _disc(self, name: str) -> str:
        """Return the signal of a brake's disc temperature."""
        return self._motion.brakes[name].state_name("T_disc")

    def _bench(self, heat: Heat, scale: float) -> StopBench:
        plan = self.plan
        assert plan.bench is not None
        options = plan.bench.chosen_options
        demand = {name: scale * options.value(name) for name in self.whole.demand}
        own = {**plan.bench.options, **demand} if scale != 1.0 else plan.bench.options
        return StopBench.of(plan.bench, options=own, heat=heat, motion=self._motion)

    def _adjusted(self, heat: Heat, scale: float, k: int) -> tuple[float, Result]:
        """Return the factor of the demand for the required deceleration, and the run with it."""
        plan = self.plan
        assert plan.deceleration is not None
        low, high = 0.0, math.inf
        reached = math.nan
        for _ in range(_ADJUSTMENTS):
            result = _run(self._bench(heat, scale))
            reached = result.kpi("mfdd").value
            if math.isnan(reached):
                break
            if abs(reached / plan.deceleration - 1.0) <= _CLOSE:
                return scale, result
            low, high = (scale, high) if reached < plan.deceleration else (low, scale)
            guess = scale * plan.deceleration / reached
            inside = low < guess < high
            scale = guess if inside else 0.5 * (low + high) if high < math.inf else 2.0 * scale
        why = (
            "The vehicle does not come to a standstill. Increase options.duration"
            if math.isnan(reached)
            else f"After {_ADJUSTMENTS} adjustments, it is {shown(reached, 'm/s**2')}"
        )
        raise RunError(
            f"stop {k + 1} of {quoted(plan.name)} cannot be adjusted to a deceleration of "
            f"{shown(plan.deceleration, 'm/s**2')}. {why}",
            name="deceleration",
            value=shown(plan.deceleration, "m/s**2"),
        )

    def _stop(
        self, heat: Heat, begin: float, scale: float, k: int, adjusted: Result | None
    ) -> tuple[Stop, Heat | None, float]:
        """Return a stop, the temperatures at its end, and its duration [s].

        The temperatures are None if the recording ends before the stop. ``adjusted``: the run of
        this stop that adjusted its demand.
        """
        plan, motion = self.plan, self._motion
        bench, has_error = self._bench(heat, scale), self.estimate_error and bool(plan.limits)
        result = None if has_error else adjusted
        result = result or _run(bench, has_error)
        rows = result.recordings[motion.label]
        course, left = self._course(rows, k)
        demand = {f"demand_{name}": bench.chosen_options.value(name) for name in self.whole.demand}
        kpis = (*self.whole.demand_figures(**demand), *result.kpis)
        gaps = [NotShown(figure, text, f"missing: {names}") for figure, text, names in plan.unknown]
        verdicts, further = self._judged(kpis)
        stop = Stop(
            plan,
            k + 1,
            1,
            kpis,
            verdicts,
            (*gaps, *further),
            tuple(result.warnings),
            begin,
            course,
        )
        return stop, left, float(course["time"][-1])

    def _course(self, rows: Any, k: int) -> tuple[dict[str, Array], Heat | None]:
        """Return the course of a stop until the brakes open, and the temperatures at its end.

        Raises
        ------
        RunError
            If the stop does not end, and has no limit that could be missed.
        """
        plan, motion = self.plan, self._motion
        t, v = rows["time"].values, rows[motion.v].values
        ended = np.flatnonzero((t > 0.0) & (v <= plan.until))
        if not ended.size and not plan.limits:
            raise RunError(
                f"stop {k + 1} of {quoted(plan.name)} does not slow down to "
                f"{shown(plan.until, 'm/s', 'km/h')} within its recording of "
                f"{shown(float(t[-1]), 's')}. Increase options.duration, or the demand",
                name=plan.name,
            )
        last = int(ended[0]) if ended.size else t.size - 1
        kept = slice(int(np.searchsorted(t, -1e-9)), last + 1)
        course = {"time": t[kept], motion.v: v[kept]}
        left: dict[str, disc_heat.State] = {}
        for name, each in motion.temperatures(rows).items():
            course[self._disc(name)] = each["T_disc"][kept]
            left[name] = disc_heat.State(*(float(each[key][last]) for key in each))
        return course, left if ended.size else None

    def _judged(self, kpis: Sequence[Kpi]) -> tuple[tuple[Verdict, ...], tuple[NotShown, ...]]:
        by_name = {kpi.name: kpi for kpi in kpis}
        verdicts, gaps = [], []
        for limit in self.plan.limits:
            kpi = by_name[limit.figure]
            if limit.at is not None:
                verdicts.append(verdict_of(limit.at(self.plan.v_0), kpi))
                continue
            earlier = [stop.kpi(limit.figure) for stop in self.before if stop.plan.name == limit.of]
            known = [each for each in earlier if each is not None]
            if not known:
                gaps.append(NotShown(limit.figure, limit.text, f"{limit.of} was not run"))
                continue
            value = sum(each.value for each in known) / len(known)
            if math.isnan(value):
                reason = f"{limit.figure} of {limit.of} has no value"
                gaps.append(NotShown(limit.figure, limit.text, reason))
                continue
            bound = limit.share * max(each.bound for each in known)
            further = replace(kpi, error=kpi.bound + bound, converges=True)
            verdicts.append(verdict_of(limit.beside(value), further))
        return tuple(verdicts), tuple(gaps)
