"""Choice of the step with which the key figures of a bench have a stated numerical error.

bywire tries steps that divide all sample times, beginning with the longest one, and estimates the
error with each of them in the same way as `bywire.bench.step_error`. The error of a figure is
relative to its own magnitude, or to the maximum of the signals from which it is computed, if that
is larger. A small difference between large signals, such as a steady-state error, is therefore
judged like the signals.

The choice is a function of the benches: the same bench always has the same step.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench import running
from bywire.bench.bench import Bench, StepChoice
from bywire.bench.ensemble import changed, key_figures_of
from bywire.bench.experiment import FINEST, LARGEST_ERROR, error_text, longest_choice
from bywire.bench.kpis.families import FAMILIES, FamilyJudge, signals_of_setting
from bywire.bench.kpis.kpi import BOUND
from bywire.bench.running import Result
from bywire.bench.step_error import ROUNDING, estimate, peaks_of, reading_error, steps_of
from bywire.core.callers import option
from bywire.core.errors import BywireError, DeviceError, InputError, RunError, StepError
from bywire.core.typing import Array, Progress
from bywire.core.units import shown
from bywire.simulation.run_table import doubts_of

if TYPE_CHECKING:
    import xarray as xr

_PERCENT = 100.0
_COUNTS = sorted(2**a * 5**b for a in range(1, 24) for b in range(10))
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_HALF = 0.5
_LEAST_RATIO = 0.1  # of a step to the previous one that was tried


def with_chosen_step(
    bench: Bench,
    variations: Sequence[Mapping[str, Any]] = (),
    progress: Progress | None = None,
    engine: str = "auto",
) -> Bench:
    """Return a bench with the longest step that meets its stated error.

    A bench that states no error, or has a chosen step, is returned unchanged.

    Parameters
    ----------
    bench
        The bench. Its key figures with limits must meet the error, or all key figures if there are
        no limits.
    variations
        Parameters and options [SI] of cases that must also meet the error, by name. Cases that the
        experiment rejects, or that fail with every step, are ignored.
    progress
        Called with a label and the completed fraction, 0 to 1.
    engine
        Engine of the runs. ``auto`` uses the bench's engine.

    Raises
    ------
    StepError
        When no step meets the error, with the error that was reached.
    RunError
        When the bench fails with every step.
    """
    if bench.error is None or bench.choice is not None:
        return bench
    tried = bench if engine == "auto" else replace(bench, engine=engine)
    return replace(bench, **_chosen(_Trials(tried, variations), progress))


def _chosen(trials: _Trials, progress: Progress | None) -> dict[str, Any]:
    """Return the chosen step as fields of a bench."""
    stated = float(trials.bench.error or 0.0)
    steps = list(permitted_steps(trials.benches))
    tried: list[_Trial] = []
    failure: RunError | None = None
    longest = math.inf
    for k, step in enumerate(steps):
        if step > longest:
            continue
        if progress is not None:
            progress(f"error with steps of {shown(step, 's', 'us')}", k / len(steps))
        try:
            trial = trials.confirmed(step, stated)
        except RunError as error:
            failure = error
            continue
        reached = trial.errors.reached
        if not trial.doubt and reached <= stated:
            choice = StepChoice(stated, step, reached, trial.errors.figure, trials.count)
            return {"step": step, "choice": choice}
        tried.append(trial)
        if stated < reached < math.inf:  # second order rules out steps in between
            skipped = max(math.sqrt(stated / reached), _LEAST_RATIO)
            longest = max(step * skipped, steps[-1])
    if not tried:
        assert failure is not None
        raise failure
    sound = [trial for trial in tried if not trial.doubt] or tried[-1:]
    best = min(sound, key=lambda trial: trial.errors.reached)
    raise _unreached(trials.bench, best, steps[-1])


def spread_over(values: Sequence[Any], most: int = 16) -> list[Any]:
    """Return at most ``most`` values, evenly spread from the first value to the last one."""
    count = min(most, len(values))
    if not count:
        return []
    places = np.unique(np.linspace(0.0, len(values) - 1.0, count).round().astype(int))
    return [values[k] for k in places.tolist()]


def exceeded(result: Result) -> str:
    """Return a warning if the estimated errors of a result exceed its stated error."""
    bench = result.bench
    if bench.choice is None or not result.recordings:
        return ""
    scales, intervals = scales_of(bench, result.recordings), _intervals(bench)
    texts = []
    for kpi in result.kpis:
        scale = max(abs(kpi.value), scales.full.get(kpi.name, 0.0))
        if kpi.name not in (bench.limits or [kpi.name]) or not scale > 0.0:
            continue
        beside = scales.rounding.get(kpi.unit, 0.0)
        beside += reading_error(kpi.value, intervals) if kpi.unit == "s" else 0.0
        error = (1.0 if kpi.converges else BOUND) * max(kpi.error - beside, 0.0) / scale
        if error > bench.choice.stated * (1.0 + error):  # the choice also scales with other steps
            texts.append(f"{kpi.name} {percent_text(error)}")
    if not texts:
        return ""
    stated = error_text(bench.choice.stated)
    return f"numerical errors exceed simulation.error = {stated}: {', '.join(texts)}"


def percent_text(error: float) -> str:
    """Return an estimated error in percent with two digits."""
    return f"{100.0 * error:.2g} %" if math.isfinite(error) else "unknown"


def _intervals(bench: Bench) -> set[float]:
    return {case.record for case in bench.cases()}


def permitted_steps(benches: Iterable[Bench]) -> Iterator[float]:
    """Yield the steps [s] that bywire may choose for several benches, the longest one first.

    They and their doubles divide all sample times and recording intervals, and have few digits.
    """
    runs = [(bench, case) for bench in benches for case in bench.cases()]
    intervals = {each for bench, case in runs for each in case.intervals(bench.record)}
    if not intervals:  # a static characteristic, without runs
        yield Bench.step
        return
    longest = longest_choice(intervals)
    for count in _COUNTS:
        step = float(f"{longest / count:.12g}")
        if step < FINEST:
            return
        yield step


def _unreached(bench: Bench, best: _Trial, finest: float) -> StepError:
    """Return the error for a stated error that no step meets.

    ``best``: the trial with the smallest error; ``finest``: the shortest step [s].
    """
    stated, reached = error_text(float(bench.error or 0.0)), _rounded_up(best.errors.reached)
    figure = best.errors.figure
    advice = [option("overrides", {"simulation.step": "20us"})]
    if best.doubt:
        why = best.doubt
    elif math.isinf(reached):
        why = f"{figure} is defined only with some steps"
    else:
        is_scattered = figure in best.errors.scattered
        scatter = ", whose values scatter from step to step,"
        why = (
            f"{figure}{scatter if is_scattered else ''} has a numerical error of up to "
            f"{error_text(reached)} with a step of {shown(best.step, 's', 'us')}"
        )
        if reached <= LARGEST_ERROR:
            advice.insert(0, option("overrides", {"simulation.error": error_text(reached)}))
    also = "" if bench.limits else ", or limit the key figures that matter in [requirements]"
    return StepError(
        f"simulation.error = {stated} cannot be reached with steps of "
        f"{shown(finest, 's', 'us')} or longer: {why}. Type {' or '.join(advice)}{also}",
        name="simulation.error",
        value=stated,
        valid=f">= {error_text(reached)}" if reached <= LARGEST_ERROR else "",
    )


def _rounded_up(error: float) -> float:
    """Return an error rounded up to one digit.

    Examples
    --------
    >>> _rounded_up(0.00123)
    0.002
    """
    if not math.isfinite(error) or error <= 0.0:
        return error
    unit = 10.0 ** math.floor(math.log10(error))
    return float(f"{math.ceil(error / unit * (1.0 - 1e-9)) * unit:.3g}")


@dataclass(frozen=True)
class Errors:
    """Numerical errors of the key figures that must meet the stated error, as fractions.

    Parameters
    ----------
    each
        Errors by key figure, shape (benches,); infinite where a figure is defined only with some
        steps, NaN where it is not defined.
    scattered
        Key figures that do not converge in at least one bench.
    """

    each: Mapping[str, Array]
    scattered: frozenset[str]

    @cached_property
    def figure(self) -> str:
        """Name of the key figure with the largest error; empty if no figure is defined."""
        largest = {name: _largest(errors) for name, errors in self.each.items()}
        return max(largest, key=lambda name: largest[name], default="")

    @property
    def reached(self) -> float:
        """Largest error."""
        return _largest(self.each[self.figure]) if self.figure else 0.0


def _largest(errors: Array) -> float:
    return float(np.max(np.nan_to_num(errors, nan=0.0, posinf=math.inf), initial=0.0))


@dataclass(frozen=True)
class Scales:
    """Magnitudes of the signals of a bench.

    Parameters
    ----------
    full
        Maximum magnitude of the signals from which a key figure is computed, by figure; 100 for a
        percentage. Figures whose signals are not declared, or have another unit, are left out.
    rounding
        Difference that rounding alone explains, by unit.
    """

    full: Mapping[str, float]
    rounding: Mapping[str, float]


def scales_of(bench: Bench, recordings: Mapping[str, xr.Dataset]) -> Scales:
    """Return the magnitudes of the signals of a bench's recordings."""
    units = bench.definition.kpis_with(bench.chosen_options)
    full = {name: _PERCENT for name, unit in units.items() if unit == "%"}
    judge = bench.definition.judge
    settings = judge.settings(bench.chosen_options) if isinstance(judge, FamilyJudge) else {}
    for family, setting in settings.items():
        (recording,) = recordings.values()
        signals = [recording[n] for n in signals_of_setting(setting) if n in recording]
        for name in FAMILIES.find(family).measures.keys() & units.keys() - full.keys():
            sizes = [_size(each) for each in signals if each.attrs.get("units") == units[name]]
            if sizes:
                full[name] = max(sizes)
    rounding = {unit: ROUNDING * peak for unit, peak in peaks_of(recordings).items()}
    return Scales(full, rounding)


def _size(signal: xr.DataArray) -> float:
    return float(np.max(np.abs(signal.values), initial=0.0))


@dataclass(frozen=True)
class Figures:
    """Key figures of some benches with one step.

    Parameters
    ----------
    values
        Values by key figure, shape (benches,); NaN where they are not defined.
    failed
        Whether the runs of a bench fail, shape (benches,).
    warnings
        Warnings of the first bench.
    """

    values: Mapping[str, Array]
    failed: NDArray[np.bool_]
    warnings: tuple[str, ...] = ()


def errors_of(
    bench: Bench, here: Figures, others: Mapping[float, Figures], scales: Scales
) -> Errors:
    """Return the numerical errors of some benches.

    Parameters
    ----------
    bench
        The bench, with the step.
    here
        Key figures with this step.
    others
        Key figures with other steps, by their ratio to this one.
    scales
        Magnitudes of the signals.
    """
    units = bench.definition.kpis_with(bench.chosen_options)
    intervals = _intervals(bench)
    errors, scattered = {}, set()
    for name in bench.limits or here.values:
        each = np.full(here.failed.size, math.nan)
        for k, value in enumerate(here.values[name].tolist()):
            if here.failed[k]:
                continue
            known = {f: float(o.values[name][k]) for f, o in others.items() if not o.failed[k]}
            full = scales.full.get(name, 0.0)
            scale = float(np.nanmax([abs(value), full, *map(abs, known.values())]))
            rounding = max(scales.rounding.get(units[name], 0.0), ROUNDING * scale)
            error, converges = estimate(value, known, rounding)
            bound = error if converges else BOUND * error
            if bound <= 2.0 * rounding:
                bound = 0.0
            elif units[name] == "s":  # a time read at a row is accurate to one row with any step
                bound = max(bound - reading_error(value, intervals), 0.0)
            each[k] = bound / scale if 0.0 < bound < math.inf else bound
            if bound and not converges:
                scattered.add(name)
        errors[name] = each
    return Errors(errors, frozenset(scattered))


# --- Trials


@dataclass(frozen=True)
class _Trial:
    """Errors with a step.

    ``step``: the step [s]; ``doubt``: the reason why the step is too long for the runs.
    """

    step: float
    errors: Errors
    doubt: str = ""


class _Trials:
    """Key figures of a bench and its variations with several steps, each computed once."""

    def __init__(self, bench: Bench, variations: Sequence[Mapping[str, Any]]) -> None:
        self.bench = bench
        made = [(each, _changed(bench, each)) for each in variations]
        self._variations = [each for each, varied in made if varied is not None]
        self.benches = [bench, *(varied for _, varied in made if varied is not None)]
        self._known: dict[float, Figures] = {}

    @property
    def count(self) -> int:
        """Number of benches."""
        return len(self.benches)

    def confirmed(self, step: float, stated: float) -> _Trial:
        """Return the errors with a step, confirmed with half the step if they meet the stated one.

        A figure whose values scatter may meet the error by chance, and may appear to converge. If a
        figure does not converge with one of the two steps, its error is at least the root mean
        square of the two errors.

        Raises
        ------
        RunError
            When the bench itself fails with this step, or with a shorter one.
        """
        trial = self.at(step)
        errors = trial.errors
        if trial.doubt or errors.reached > stated:
            return trial
        half = self.at(_HALF * step).errors
        if not half.each:
            return trial
        each, scattered = dict(errors.each), errors.scattered | half.scattered
        for name in scattered:
            square = 0.5 * (errors.each[name] ** 2 + half.each[name] ** 2)
            each[name] = np.fmax(errors.each[name], np.sqrt(square))
        return _Trial(step, Errors(each, scattered))

    def at(self, step: float) -> _Trial:
        """Return the errors with a step.

        Raises
        ------
        RunError
            When the bench itself fails with this step, or with a shorter one.
        """
        bench = _with_step(self.bench, step)
        runs = (run for each in self._with(step) if each for run in each.runs().values())
        doubts = (text for run in runs for text in doubts_of([run]))
        if doubt := next(filter(None, doubts), ""):
            return _Trial(step, Errors({}, frozenset()), doubt)
        here = self._figures(step)
        others: dict[float, Figures] = {}
        for factor in steps_of(bench.runs().values()):
            try:
                others[factor] = self._figures(factor * step)
            except RunError:
                if factor < 1.0:
                    raise
        result = running.run(bench)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        errors = errors_of(bench, here, others, scales_of(bench, result.recordings))
        finer = {_masked(text) for text in others[_HALF].warnings}
        new = (text for text in here.warnings if _masked(text) not in finer)
        return _Trial(step, errors, next(new, ""))

    def _figures(self, step: float) -> Figures:
        if step not in self._known:
            self._known[step] = figures_of(self._with(step))
        return self._known[step]

    def _with(self, step: float) -> list[Bench | None]:
        bench = _with_step(self.bench, step)
        return [bench, *(_changed(bench, each) for each in self._variations)]


def figures_of(benches: Sequence[Bench | None]) -> Figures:
    """Return the key figures of benches of one experiment; None for a bench that is not valid.

    Raises
    ------
    RunError
        When the first bench fails. The figures of any other bench that fails are not defined.
    """
    first = benches[0]
    assert first is not None
    names = first.definition.kpis_with(first.chosen_options)
    values = {name: np.full(len(benches), math.nan) for name in names}
    failed = np.ones(len(benches), dtype=bool)
    warnings: list[str] = []
    groups: dict[str, list[int]] = {}
    for k, bench in enumerate(benches):
        if bench is None:
            continue
        choices = bench.par.choices(), bench.chosen_options.choices()
        groups.setdefault(str(choices), []).append(k)
    pending = list(groups.values())
    while pending:
        group = pending.pop()
        try:
            made = key_figures_of([each for k in group if (each := benches[k]) is not None])
        except DeviceError:
            raise
        except BywireError:
            if group == [0]:
                raise
            if len(group) > 1:  # a single bench may rule out a joint run
                pending += [[k] for k in group]
            continue
        failed[group] = False
        for figure in made.figures:
            values[figure.name][group] = figure.values
        if 0 in group:
            warnings += made.warnings[group.index(0)]
    return Figures(values, failed, tuple(warnings))


def _with_step(bench: Bench, step: float) -> Bench:
    return replace(bench, step=step, error=None, choice=None)


def _changed(bench: Bench, variation: Mapping[str, Any]) -> Bench | None:
    """Return a bench with other parameters and options; None if it is not valid."""
    try:
        return changed(bench, variation)
    except InputError:
        return None


def _masked(text: str) -> str:
    """Return a warning without its numbers, which depend on the step."""
    return _NUMBER.sub("#", text)
