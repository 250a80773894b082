"""Parameters from measurements, by a named method or by one of any bench."""

from __future__ import annotations

import filecmp
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from bywire.api.parameter_choice import set_for
from bywire.api.replay import columns_of_bench, driven_bench
from bywire.bench.changes import settled
from bywire.core.callers import is_command_line, option
from bywire.core.errors import InputError, ParameterError, unknown_name, unknown_of_few
from bywire.core.typing import Progress, silent
from bywire.core.values import parsed
from bywire.data.named_columns import NamedColumns
from bywire.identification.measured import Measured, measured, name_of, require_signals
from bywire.identification.method import Effort, Identified
from bywire.identification.question import BENCH_METHODS, BenchMethod, Question, find_method
from bywire.identification.trust import displaced
from bywire.report.document import Change
from bywire.report.subject import Subject, defaults_of, value_changes

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.identification.method import Method

Source = str | Path | xr.Dataset
"""a measurement: a file, or what `bywire.read_measurement` gives"""


@dataclass(frozen=True)
class ChosenMethod:
    """A method with its parameters and options.

    Parameters
    ----------
    method, options
        What is done, and how.
    name, par
        Parameter set and values from which the search begins; empty and None for a method of any
        assembly.
    changes
        What of the parameter set was changed, by dotted name, SI.
    """

    method: Method
    options: ParameterSet
    name: str = ""
    par: ParameterSet | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def subject(self) -> Subject | None:
        """What a report says of the method's brake; None for a method of any assembly."""
        method = self.method
        if method.bench is not None:
            return Subject.of_bench(
                method.bench, method.name, method.summary, further=self._option_changes
            )
        if self.par is None:
            return None
        return Subject(
            method.name, method.summary, self.name, self.par, further=self._option_changes
        )

    @property
    def changed(self) -> tuple[Change, ...]:
        """What the user changed of the bench or parameter set, and of the method's options."""
        return self._option_changes if self.subject is None else self.subject.changes

    @property
    def _option_changes(self) -> tuple[Change, ...]:
        method = self.method
        return value_changes(self.options, method.defaults.flat(), defaults_of(method.name))


def choose(
    name: str,
    parameters: str,
    overrides: Mapping[str, Any],
    options: Mapping[str, Any],
    question: Question,
    *,
    measurements: Sequence[Source] = (),
    mapping: str | Path | None = None,
    time: str = "",
    progress: Progress = silent,
) -> ChosenMethod:
    """Return the method of a name with what it needs.

    Parameters
    ----------
    name
        Method of ``bywire list``.
    parameters, overrides, options
        Parameter set, and what of it and of the method's options is changed.
    question
        For methods of any bench.
    measurements, mapping, time
        What is identified, what the columns of its files mean, and which one holds the instants;
        none for simulated ones.
    progress
        Called with a label and the finished share.

    Raises
    ------
    InputError
        When something does not fit.
    """
    bench_method = BENCH_METHODS.all().get(name)
    if bench_method is None:
        method = find_method(name)
        _require_columns_alone(method, question)
    else:
        if question.holdout is not None:
            _require_not_fitted(question.holdout, measurements)
        chosen = {"parameters": parameters} if parameters else {}
        method = _on_bench(bench_method, question, {**chosen, **overrides}, mapping, time, progress)
    if len(measurements) > 1 and not method.several:
        raise ParameterError(f"{name} takes one measurement, not {len(measurements)}")
    idle = [key for key in options if key.split(".")[0] in method.simulated]
    if measurements and idle:
        raise ParameterError(
            f"option {idle[0]} of {name} only shapes simulated experiments: leave it out for "
            "measurement files"
        )
    loss = {"loss": question.loss} if question.loss else {}
    return _with_parameters(method, _options(method, {**options, **loss}), parameters, overrides)


def _require_columns_alone(method: Method, question: Question) -> None:
    """Refuse what methods of any bench take, but columns of the method's signals.

    Raises
    ------
    InputError
        For anything else that is asked, and signals that the method does not take.
    """
    noisy = any(question.noise.values())
    beyond = [name for name in question.given if name not in ("inputs", "outputs")]
    if beyond or noisy:
        raise ParameterError(
            f"{option(beyond[0] if beyond else 'outputs')}{'' if beyond else ' with a noise'} is "
            f"for methods of any bench "
            f"({', '.join(BENCH_METHODS.all())}): leave it out for {method.name}"
        )
    signals = {**method.signals, **method.optional}
    for name in (*question.inputs, *question.columns):
        if name not in signals:
            raise unknown_of_few(f"signal of {method.name}", name, signals)


def columns_of(method: Method, question: Question, time: str) -> NamedColumns:
    """Return the columns of measurement files that a question names.

    Parameters
    ----------
    method
        What takes the signals.
    question
        Columns of outputs, and of what drives the model.
    time
        Column of the instants.

    Raises
    ------
    ParameterError
        When one name means two columns.
    """
    outputs = question.columns
    units = {**method.optional, **method.signals}
    if method.bench is None:
        return NamedColumns({**question.inputs, **outputs}, time, units)
    return columns_of_bench(question.inputs, outputs, time, units)


def _with_parameters(
    method: Method, options: ParameterSet, parameters: str, overrides: Mapping[str, Any]
) -> ChosenMethod:
    if not method.assembly:
        if parameters or overrides:
            raise ParameterError(
                f"{method.name} needs no parameters: leave out {option('parameters')} and "
                f"{option('overrides')}"
            )
        return ChosenMethod(method, options)
    if method.bench is not None:
        bench = method.bench
        changes = parsed(type(bench.par), bench.overrides, "parameter")
        return ChosenMethod(method, options, bench.parameters, bench.par, changes)
    cited = set_for(f"method {method.name!r}", method.assembly, parameters)
    base = cited.parameters()
    for key in overrides:
        if key in options.flat() and key not in base.flat():
            raise unknown_name(
                f"parameter ({option('options')} sets the method's)", key, base.flat()
            )
    changes = parsed(type(base), settled(base, overrides), "parameter")
    return ChosenMethod(method, options, cited.name, base.replace(changes), changes)


def _options(method: Method, values: Mapping[str, Any]) -> ParameterSet:
    """Return a method's options with some of them changed."""
    try:
        given = parsed(method.options, values, f"option of {method.name}")
        return method.defaults.replace(given)
    except InputError as error:
        raise error.reworded(f"{error}; 'bywire list {method.name}' shows the options") from None


def _require_not_fitted(holdout: Source, measurements: Sequence[Source]) -> None:
    """Refuse a held-out measurement that is fitted too, or none beside it: it proves nothing."""
    if not measurements:
        raise ParameterError(f"{option('holdout')} is for measurement files: leave it out")
    for fitted in measurements:
        if isinstance(holdout, xr.Dataset) or isinstance(fitted, xr.Dataset):
            if isinstance(fitted, xr.Dataset) and fitted is holdout:
                raise ParameterError(
                    f"{option('holdout')} is fitted too: hold out a record that is not"
                )
            continue
        try:
            equal = filecmp.cmp(fitted, holdout, shallow=False)
        except OSError:  # reading says what is wrong with it
            continue
        if equal:
            same = "is" if Path(fitted).samefile(holdout) else "has the same content as"
            raise ParameterError(
                f"{option('holdout')} {holdout} {same} {fitted}, which is fitted: hold out a "
                "record that is not"
            )


def _on_bench(
    method: BenchMethod,
    question: Question,
    changes: Mapping[str, Any],
    mapping: str | Path | None,
    time: str,
    progress: Progress,
) -> Method:
    """Return a method of any bench for the one that is asked about."""
    if question.bench is None:
        raise ParameterError(
            f"{method.name} needs {option('bench')}: a bench file (TOML), or an experiment of "
            "'bywire list'"
        )
    bench = driven_bench(question.bench, changes)
    on_bench = method.on(bench, replace(question, holdout=None))
    if question.holdout is None:
        return on_bench
    held = measured(
        [question.holdout],
        mapping,
        on_bench.signals,
        optional=on_bench.optional,
        gaps=True,
        multiple=bench.step,
        named=columns_of(on_bench, question, time),
        progress=progress,
    )
    return method.on(bench, replace(question, holdout=held.data))


# --- Identification

STARTS = "starts.jsonl"
"""file of the output folder that keeps finished starts"""

_FAR = 30.0  # times: beyond, a unit is the first suspect


def far_off(estimates: Mapping[str, float], before: Mapping[str, float]) -> list[str]:
    """Return a note for every parameter that is far from what it was, as by a wrong unit."""
    notes = []
    for name, value in estimates.items():
        known = before.get(name, 0.0)
        ratio = abs(value / known) if known else 1.0
        if ratio > _FAR or ratio * _FAR < 1.0:
            notes.append(
                f"{name} is {ratio:.3g} times what it was before: are the units of the "
                "measurement right (the map's 'unit')?"
            )
    return notes


def require_one_source(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    synthetic: int | None,
    mapping: str | Path | None,
    time: str,
) -> None:
    """Refuse both a measured and a simulated experiment, and neither; and what fits neither.

    Raises
    ------
    ParameterError
        With what is missing, or to be left out.
    """
    method = chosen.method
    study = f"{option('study') if is_command_line() else 'bywire.trust, with count'} COUNT"
    if sources and synthetic is not None:
        raise ParameterError(
            f"{method.name}: give only one of measurement files, {option('synthetic')} SEED, "
            f"{study}"
        )
    if not sources and synthetic is None:
        signals = ", ".join(f"{n} [{unit}]" for n, unit in method.signals.items())
        raise ParameterError(
            f"{method.name} needs one of: measurement files with the signals {signals}, "
            f"{option('synthetic')} SEED, or {study}"
        )
    for name, given in {"mapping": mapping is not None, "time": bool(time)}.items():
        if given and not sources:
            raise ParameterError(f"{option(name)} is for measurement files: leave it out")


def data_of(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    mapping: str | Path | None,
    named: NamedColumns,
    synthetic: int | None,
    progress: Progress,
) -> tuple[Measured, str]:
    """Return the measurement, and what it is in one line."""
    method = chosen.method
    if synthetic is None:
        read = measured(
            sources,
            mapping,
            method.signals,
            optional=method.optional,
            gaps=method.gaps,
            multiple=None if method.bench is None else method.bench.step,
            named=named,
            progress=progress,
        )
        return read, ", ".join(name_of(source) for source in sources)
    progress("simulated experiment", 0.0)
    data = method.synthetic(chosen.par, chosen.options, synthetic)
    progress("simulated experiment", 1.0)
    made_of = f" of {chosen.name}" if chosen.name else ""
    return Measured(data, ()), f"simulated experiment{made_of}, seed {synthetic}"


def start_of(chosen: ChosenMethod, synthetic: int | None) -> ParameterSet | None:
    """Return the parameters from which the search begins: off those that were put in."""
    if synthetic is None or chosen.par is None:
        return chosen.par
    return displaced(chosen.par, chosen.method.unknowns, Effort().spread, synthetic)


def search(
    chosen: ChosenMethod, start: ParameterSet | None, data: xr.Dataset, effort: Effort
) -> Identified:
    """Return what the method finds; an interrupted search says where its starts are kept.

    Raises
    ------
    KeyboardInterrupt
        When interrupted.
    """
    require_signals(data, chosen.method.signals)
    try:
        return chosen.method.identify(data, start, chosen.options, effort)
    except KeyboardInterrupt:
        if effort.store is None or not effort.store.exists():
            raise
        raise KeyboardInterrupt(
            f"finished starts are in {effort.store}: the same command goes on from there"
        ) from None


def begun_at(
    chosen: ChosenMethod, start: ParameterSet | None, identified: Identified
) -> dict[str, float]:
    """Return the values from which the search began, by label."""
    if start is None:
        return {}
    if chosen.method.bench is None:
        return start.leaves()
    # A range that leaves out the bench's own value begins elsewhere.
    return start.leaves() | {
        u.label: u.start for e in identified.estimates.values() for u in e.all_unknowns
    }
