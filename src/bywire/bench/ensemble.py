"""One bench for many values of its parameters and options, side by side, each one judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, overload

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.option_names import OPTION, split_options
from bywire.bench.result import Result
from bywire.bench.running import Progress, judged, recording_of, static_recordings
from bywire.bench.side_by_side import rounds
from bywire.bench.step_error import MOST_WORK, NO_ESTIMATE, abandoned, steps_of, unestimated
from bywire.core.arguments import checked
from bywire.core.errors import InputError, ParameterError, unknown_name
from bywire.core.parameters import Leaf, ParameterSet, choice_fields, choices_of, leaf_fields
from bywire.core.typing import Array
from bywire.simulation import ensemble
from bywire.simulation.ensemble import Ensemble, Variations
from bywire.simulation.run import Run


def varied_choices(bench: Bench) -> Mapping[str, tuple[Any, ...]]:
    """Return what every choice of a bench that may vary can be, by its name.

    Structural choices of the brake, and of the options ``options.NAME`` those that are listed
    or true or false: a text of another kind names a signal, or a file.
    """
    return choices_that_vary(type(bench.par), type(bench.chosen_options))


@lru_cache(maxsize=64)  # the cases of a study ask for the same ones
def choices_that_vary(
    of: type[ParameterSet], chosen: type[ParameterSet]
) -> Mapping[str, tuple[Any, ...]]:
    """Return the same by the classes of a bench's parameters and options."""
    options = {f"{OPTION}{name}": choices_of(chosen, name) for name in choice_fields(chosen)}
    parameters = {name: choices_of(of, name) for name in choice_fields(of)}
    return parameters | {name: admitted for name, admitted in options.items() if admitted}


# --- The ensemble


@dataclass(frozen=True)
class BenchEnsemble:
    """What a bench gave for many values.

    Parameters
    ----------
    variations
        Parameter, or ``options.NAME``, by name -> its value [SI] in each case, shape (cases,).
    results
        What each case gave, judged by the bench's requirements.
    """

    variations: Mapping[str, Array]
    results: tuple[Result, ...]

    def kpi(self, name: str) -> Array:
        """Return a key figure of every case, shape (cases,); NaN where it is not defined."""
        return np.array([result.kpi(name).value for result in self.results])

    @property
    def met(self) -> NDArray[np.bool_]:
        """Whether each case meets all requirements, shape (cases,)."""
        return np.array([all(v.met for v in result.verdicts) for result in self.results])

    def __getitem__(self, signal: str) -> xr.DataArray:
        """Return a signal of an experiment that makes one run, dimensions case and time.

        Raises
        ------
        UnknownNameError
            When there is no such signal.
        ParameterError
            When the experiment makes several runs: take ``results[k].recordings``.
        """
        each = [result.recording for result in self.results]
        if signal not in each[0]:
            raise unknown_name("signal", signal, map(str, each[0].data_vars))
        joined = xr.concat([recording[signal] for recording in each], dim="case", join="outer")
        return joined.assign_coords({name: ("case", v) for name, v in self.variations.items()})


@overload
def simulate_ensemble(
    run: Run,
    variations: Variations,
    signals: Sequence[str],
    threads: int | None = None,
    engine: str = "auto",
) -> Ensemble: ...


@overload
def simulate_ensemble(
    run: Bench,
    variations: Variations,
    signals: None = None,
    threads: int | None = None,
    engine: str = "auto",
) -> BenchEnsemble: ...


@checked
def simulate_ensemble(
    run: Run | Bench,
    variations: Variations,
    signals: Sequence[str] | None = None,
    threads: int | None = None,
    engine: str = "auto",
) -> Ensemble | BenchEnsemble:
    """Compute one run, or a bench with all its runs, for many values of its parameters.

    Parameters
    ----------
    run
        A run: model, parameters, initial values, stimulus, steps; see
        `bywire.simulation.ensemble.simulate_ensemble`. Or a bench: every case then starts where
        the experiment starts it with these parameters, and has its key figures and verdicts.
    variations
        Dotted name of a parameter, or of a bench ``options.NAME`` -> its value [SI] in each case,
        shape (cases,). What is not named keeps its value.
    signals
        Outputs of a run to record. A bench records all that its key figures need.
    threads
        Threads to use, >= 1; all cores by default.
    engine
        What computes: ``auto``, the bench's own or lanes of this machine's processor;
        ``compiled``, ``virtual-machine``, or ``cuda``, a graphics processor (``docs/studies.md``).

    Returns
    -------
    Ensemble
        Of a run: its signals, shape (cases, rows) each.
    BenchEnsemble
        Of a bench: recordings, key figures and verdicts of every case.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and variations of several lengths.
    RunError
        When a trajectory leaves the numbers.
    """
    if isinstance(run, Run):
        if signals is None:
            raise ParameterError("signals are missing: name the outputs of the run to record")
        return ensemble.simulate_ensemble(run, variations, signals, threads, engine)
    if signals is not None:
        raise ParameterError("a bench records all signals: leave signals out")
    arrays = {name: np.atleast_1d(np.asarray(v, dtype=float)) for name, v in variations.items()}
    lengths = {name: array.size for name, array in arrays.items()}
    if not arrays or len(set(lengths.values())) != 1 or 0 in lengths.values():
        raise ParameterError(f"variations must have one length >= 1 each, got {lengths}")
    benches = [
        changed(run, {name: float(array[k]) for name, array in arrays.items()})
        for k in range(next(iter(lengths.values())))
    ]
    return BenchEnsemble(arrays, run_benches(benches, engine=engine, threads=threads))


def varied_leaf(bench: Bench, name: str) -> Leaf:
    """Return the description of a parameter, or of an option ``options.NAME``, that may vary.

    Raises
    ------
    UnknownNameError
        With the nearest numbers of the bench.
    """
    return _varied_leaf(type(bench.par), type(bench.chosen_options), name)


def _varied_leaf(of: type[ParameterSet], chosen: type[ParameterSet], name: str) -> Leaf:
    parameters = leaf_fields(of)
    if name in parameters:
        return parameters[name]
    known = {f"{OPTION}{option}": leaf for option, leaf in leaf_fields(chosen).items()}
    if name not in known:
        raise unknown_name("parameter or option to vary", name, {**parameters, **known})
    return known[name]


class _Names(NamedTuple):
    """Names of what is changed of a bench."""

    parameters: tuple[str, ...]
    options: tuple[tuple[str, str], ...]
    """each with its name among the options"""
    switches: frozenset[str]
    """those that are true or false"""


@lru_cache(maxsize=64)  # the cases of a study all change the same
def _names_within(
    of: type[ParameterSet], chosen: type[ParameterSet], names: tuple[str, ...]
) -> _Names:
    """Return which names are of parameters and which of options, or refuse one that is of none."""
    choices = choices_that_vary(of, chosen)
    for name in names:
        if name not in choices:
            _varied_leaf(of, chosen, name)
    parameters, options = split_options({name: name for name in names})
    switches = frozenset(n for n in names if choices.get(n) == (False, True))
    return _Names(tuple(parameters), tuple((n, own) for own, n in options.items()), switches)


def changed(bench: Bench, values: Mapping[str, float | str], seed: int | None = None) -> Bench:
    """Return a bench with other parameters, choices and options [SI], and noise of another seed.

    What is true or false is a text, ``"true"`` or ``"false"``, as other choices are.

    Raises
    ------
    InputError
        When one is unknown or out of range, or contradicts another; the values are named.
    """
    names = _names_within(type(bench.par), type(bench.chosen_options), tuple(values))
    plain: Mapping[str, Any] = values
    if names.switches:
        plain = {**values, **{name: values[name] in (True, "true") for name in names.switches}}
    overrides = {name: plain[name] for name in names.parameters}
    options = {within: plain[name] for name, within in names.options}
    try:
        return bench.varied(overrides, options, seed)
    except InputError as error:
        said = ", ".join(
            f"{name} = {value}" if isinstance(value, str) else f"{name} = {value:g}"
            for name, value in values.items()
        )
        raise error.reworded(f"{said} (in SI): {error}") from None


def run_benches(
    benches: Sequence[Bench],
    progress: Progress | None = None,
    engine: str = "auto",
    threads: int | None = None,
    estimate_error: bool = False,
) -> tuple[Result, ...]:
    """Make all runs of several benches of one experiment, and judge each bench.

    Cases that differ in numbers alone (parameters, initial values, stimuli) run side by side in
    lanes; others, and all without a compiler, one after the other.

    Parameters
    ----------
    benches
        Benches of one experiment.
    progress
        Called with a run's label and the finished share, 0 to 1.
    engine
        ``auto``, ``compiled``, ``cuda``, or ``virtual-machine``, which has no lanes.
    threads
        Threads to use, >= 1; all cores by default.
    estimate_error
        Whether all runs are made again in other steps; see `bywire.bench.running.run`.

    Raises
    ------
    StepError
        When the runs do not fit into this machine together, or steps do not divide each other.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """
    work: list[dict[str, float]] = [{} for _ in benches]
    recordings = _recordings(benches, progress, engine, threads, work)
    limits = [{label: MOST_WORK * each for label, each in done.items()} for done in work]
    others: list[dict[float, dict[str, xr.Dataset]]] = [{} for _ in benches]
    failures: list[dict[float, Exception]] = [{} for _ in benches]
    for factor in steps_of(benches[0].runs().values()) if estimate_error else ():
        with suppress(*NO_ESTIMATE):
            finer = [replace(bench, step=factor * bench.step) for bench in benches]
            computed = _recordings(finer, progress, engine, threads, limits=limits)
            for each, further in zip(others, computed, strict=True):
                each[factor] = further
            continue
        for bench, each, failed, most in zip(benches, others, failures, limits, strict=True):
            try:  # a single case may be what keeps them from running side by side
                other = replace(bench, step=factor * bench.step)
                (each[factor],) = _recordings([other], progress, engine, threads, limits=[most])
            except NO_ESTIMATE as error:
                failed[factor] = error
    results = map(judged, benches, recordings, others)
    notes = [
        abandoned(failed) if each else unestimated(failed) if failed else ""
        for each, failed in zip(others, failures, strict=True)
    ]
    return tuple(
        replace(result, unestimated=note) if note else result
        for result, note in zip(results, notes, strict=True)
    )


def _recordings(
    benches: Sequence[Bench],
    progress: Progress | None,
    engine: str,
    threads: int | None,
    work: Sequence[dict[str, float]] = (),
    limits: Sequence[Mapping[str, float]] = (),
) -> list[dict[str, xr.Dataset]]:
    """Return the recordings of each bench by label, and note what work they took."""
    recordings = [static_recordings(bench) for bench in benches]
    for made in rounds(benches, progress, engine, threads, limits=limits):
        given = zip(made.places, made.cases, made.runs, made.trajectories, strict=True)
        for k, case, run, trajectory in given:
            recordings[k][case.label] = recording_of(benches[k], case, run, trajectory)
            if work:
                work[k][case.label] = trajectory.work
    return recordings
