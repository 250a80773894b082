"""The bench: what is tested, how, and what is required of it. The same thing as a bench file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.experiment import Case, Experiment
from bywire.bench.extent import check_extent, check_seed, checked_interval, checked_step
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.recording import record
from bywire.bench.registry import find_experiment
from bywire.bench.requirements import Verdict, check, judge
from bywire.bench.stimuli import registry as stimuli
from bywire.bench.stimuli.registry import Stimulus
from bywire.bench.stimulus_file import with_nodes
from bywire.bench.values import parsed
from bywire.catalog.registry import entry
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.simulation.run import Run, simulate

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Bench:
    """A virtual test, complete.

    Parameters
    ----------
    experiment
        Name of the experiment.
    parameters
        Name of a parameter set of the catalog.
    overrides, options
        Other parameters and options of the experiment, by dotted name: SI numbers, or texts with
        units such as ``"0.35 ohm"``. Durations below may be written so as well.
    stimulus
        ``{"kind": ..., **parameters}`` for experiments that take a stimulus; a table may come
        from a file, see ``stimulus_file``.
    step
        Substep [s].
    record
        Recording interval [s]; None for the experiment's own.
    seed
        Seed of the sensors' noise.
    requirements
        KPI name -> limit, such as ``{"overshoot": "<= 15 %"}``.
    name
        What reports call it.

    Raises
    ------
    InputError
        At construction, for anything that does not fit.
    """

    experiment: str
    parameters: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    stimulus: Mapping[str, Any] = field(default_factory=dict)
    step: float = 20e-6
    record: float | None = None
    seed: int = 0
    requirements: Mapping[str, str] = field(default_factory=dict)
    name: str = ""

    def __post_init__(self) -> None:
        for key in ("experiment", "parameters", "name"):
            if not isinstance(getattr(self, key), str):
                raise ParameterError(f"{key} = {quoted(getattr(self, key))}: a text is wanted")
        for key in ("overrides", "options", "stimulus", "requirements"):
            object.__setattr__(self, key, dict(getattr(self, key)))  # ours alone from now on
        object.__setattr__(self, "step", checked_step(self.step))
        object.__setattr__(self, "record", checked_interval(self.record))
        check_seed(self.seed)
        chosen, found = find_experiment(self.experiment), entry(self.parameters)
        if chosen.assembly != found.assembly:
            raise ParameterError(
                f"experiment {chosen.name!r} tests a {chosen.assembly}, but parameter set "
                f"{found.name!r} is for a {found.assembly}"
            )
        if self.stimulus and chosen.driven_unit is None:
            raise ParameterError(
                f"experiment {chosen.name!r} brings its own stimulus: leave out [stimulus], or "
                "use experiment 'open-loop'"
            )
        self._check_names()
        _ = self.par, self.chosen_options, self.chosen_stimulus
        check(self.requirements, chosen.kpis)

    def _check_names(self) -> None:
        """Refuse options that stand among the parameters, the likeliest mistake of all."""
        options = self.definition.defaults.flat().keys()
        parameters = entry(self.parameters).values.keys()
        for name in self.overrides:
            if name in options and name not in parameters:
                raise unknown_name("parameter", name, [f"options.{name}"])

    @property
    def definition(self) -> Experiment:
        """The experiment behind the name."""
        return find_experiment(self.experiment)

    @cached_property
    def par(self) -> ParameterSet:
        """Validated parameters, overrides applied."""
        base = entry(self.parameters).parameters()
        return base.replace(parsed(type(base), self.overrides, "parameter"))

    @cached_property
    def chosen_options(self) -> ParameterSet:
        """Validated options of the experiment."""
        definition = self.definition
        values = parsed(definition.options, self.options, f"option of {definition.name}")
        return definition.defaults.replace(values)

    @cached_property
    def chosen_stimulus(self) -> Stimulus | None:
        """Validated stimulus; None where none is given."""
        driven_unit = self.definition.driven_unit
        if not self.stimulus or driven_unit is None:
            return None
        values = dict(self.stimulus)
        kind = values.pop("kind", None)
        if not isinstance(kind, str):
            raise ParameterError(f"[stimulus] needs a kind: {', '.join(sorted(stimuli.entries()))}")
        unit = driven_unit(self.chosen_options)
        return stimuli.create(kind, with_nodes(values, unit) if kind == "table" else values, unit)

    def cases(self) -> tuple[Case, ...]:
        """Return the runs that the experiment consists of.

        Raises
        ------
        ParameterError
            When all of them set a parameter that the bench sets otherwise.
        """
        found = self.definition.cases(self.par, self.chosen_options, self.chosen_stimulus)
        wanted, made = self.par.flat(), [case.par.flat() for case in found]
        for name in self.overrides:
            if made and all(values[name] != wanted[name] for values in made):
                raise ParameterError(
                    f"{name} = {wanted[name]!r} would have no effect: experiment "
                    f"{self.experiment!r} sets it to {made[0][name]!r}; leave it out"
                )
        return found

    def runs(self) -> dict[str, Run]:
        """Return the runs by label, for ensembles and sensitivities.

        Their time starts with the experiment's settling, ``Case.settle`` before its zero.
        """
        return {
            case.label: as_run(case, self.step, self.record, (self.seed, number))
            for number, case in enumerate(self.cases())
        }

    def with_overrides(self, overrides: Mapping[str, Any]) -> Bench:
        """Return this bench with further parameters changed."""
        return replace(self, overrides={**self.overrides, **overrides})


@dataclass(frozen=True)
class Result:
    """What a bench gave.

    Parameters
    ----------
    recordings
        One dataset per run of the experiment, by label.
    status
        ``passed``, ``failed`` (a requirement was not met) or ``interrupted``.
    """

    bench: Bench
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    status: str

    @property
    def recording(self) -> xr.Dataset:
        """The recording of an experiment that makes one run."""
        if len(self.recordings) != 1:
            labels = ", ".join(self.recordings)
            raise ParameterError(f"this experiment made several recordings: take one of {labels}")
        return next(iter(self.recordings.values()))

    def kpi(self, name: str) -> Kpi:
        """Return one KPI by name.

        Raises
        ------
        UnknownNameError
            With the nearest known names.
        """
        by_name = {kpi.name: kpi for kpi in self.kpis}
        if name not in by_name:
            raise unknown_name("KPI", name, by_name)
        return by_name[name]

    @property
    def warnings(self) -> list[str]:
        """What the user should know of the runs."""
        return [
            f"{label}: {text}" if len(self.recordings) > 1 else text
            for label, recording in self.recordings.items()
            for text in str(recording.attrs.get("warnings", "")).split("; ")
            if text
        ]


def run(bench: Bench, progress: Progress | None = None, engine: str = "auto") -> Result:
    """Make all runs of a bench, and judge them.

    Parameters
    ----------
    progress
        Called with the run's label and its finished share, 0 to 1.
    engine
        ``auto``, ``compiled`` or ``virtual-machine``.

    Raises
    ------
    InputError
        When the experiment cannot be set up.
    RunError
        When a run fails.
    """
    definition, options = bench.definition, bench.chosen_options
    recordings: dict[str, xr.Dataset] = {}
    if definition.static is not None:
        recordings |= definition.static(bench.par, options)
    try:
        for number, case in enumerate(bench.cases()):
            recording = _recorded(bench, case, number, progress, engine)
            is_complete = recording.attrs["status"] != "interrupted"
            if is_complete or recording.sizes["time"] > 1:
                finish = definition.finish or _as_it_is
                recordings[case.label] = finish(recording, options)
            if not is_complete:
                raise KeyboardInterrupt
    except KeyboardInterrupt:  # also from outside the engine, which keeps what it has
        return Result(bench, recordings, (), (), "interrupted")
    kpis = definition.judge(recordings, options)
    verdicts = judge(bench.requirements, kpis)
    status = "passed" if all(v.met for v in verdicts) else "failed"
    return Result(bench, recordings, kpis, verdicts, status)


def _as_it_is(recording: xr.Dataset, _: Any) -> xr.Dataset:
    return recording


def _recorded(
    bench: Bench, case: Case, number: int, progress: Progress | None, engine: str
) -> xr.Dataset:
    made = as_run(case, bench.step, bench.record, (bench.seed, number))
    check_extent(case, made)
    report = None if progress is None else (lambda share: progress(case.label, share))
    trajectory = simulate(made, engine=engine, progress=report)
    notes = {
        "experiment": bench.experiment,
        "case": case.label,
        "parameter_set": bench.parameters,
        "seed": bench.seed,
    }
    return record(made, trajectory, case.settle, case.keep, notes)


def as_run(
    case: Case, step: float, interval: float | None = None, seed: tuple[int, ...] = (0,)
) -> Run:
    """Return the engine's description of a case.

    The run begins at -settle on the recording's axis. Signals of the stimulus named ``noise_*``
    are standard normal, drawn from the seed.
    """
    fields = case.model.Stimulus._fields

    def stimulus(t: NDArray[np.float64]) -> NDArray[np.float64]:
        given = case.stimulus(t - case.settle)
        noise = np.random.default_rng(seed)
        rows = np.zeros((t.size, len(fields)))
        for k, name in enumerate(fields):
            if name.startswith("noise_"):
                rows[:, k] = noise.standard_normal(t.size)
            elif name in given:
                rows[:, k] = given[name]
        return rows

    return Run(
        model=case.model,
        par=case.par,
        state=case.state,
        memory=case.memory,
        stimulus=stimulus,
        duration=case.settle + case.duration,
        step=step,
        record=case.record if interval is None else interval,
    )
