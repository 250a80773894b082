"""Identification of parameters and their confidence, by a brake's or a general method."""

from __future__ import annotations

import filecmp
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from bywire.api.parameter_choice import set_for
from bywire.api.replay import columns_of_bench, driven_bench
from bywire.bench.bench import Bench
from bywire.bench.changes import settled
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.callers import is_command_line, option
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import FileError, InputError, ParameterError, unknown_name, unknown_of_few
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.typing import Progress, silent
from bywire.core.values import parsed
from bywire.data.named_columns import NamedColumns, reject_swapped
from bywire.identification.estimate import Estimate, as_object
from bywire.identification.measured import Measured, measured, name_of, require_signals
from bywire.identification.method import Effort, Identified
from bywire.identification.question import BENCH_METHODS, BenchMethod, Question, find_method
from bywire.identification.trust import displaced, put_in
from bywire.report.answer import Answer, Outcome, outcome_of
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Change,
    Details,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    spaced,
)
from bywire.report.estimate_tables import check_table, estimate_table, figure_table
from bywire.report.subject import Subject, changes_block, defaults_of, parameter_rows, value_changes
from bywire.report.tables import parameter_table

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.identification.method import Method

Source = str | Path | xr.Dataset
"""measurement: a file, or a result of `bywire.read_measurement`"""


@dataclass(frozen=True)
class ChosenMethod:
    """Method with its parameters and options.

    Parameters
    ----------
    method, options
        Method and its options.
    name, par
        Parameter set and values from which the search starts. Empty and None for a method for any
        assembly.
    changes
        Changes to the parameter set by dotted name [SI].
    """

    method: Method
    options: ParameterSet
    name: str = ""
    par: ParameterSet | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def subject(self) -> Subject | None:
        """The method's brake for reports, or None for a method for any assembly."""
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
        """The user's changes to the bench or parameter set and to the method's options."""
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
    """Find a method by name, and read its parameters and options.

    Parameters
    ----------
    name
        Method that ``bywire list`` shows.
    parameters, overrides, options
        Parameter set, changes to it, and changes to the method's options.
    question
        Inputs of methods for any bench.
    measurements, mapping, time
        Measurements, the meaning of their columns, and their time column. Empty for simulated data.
    progress
        Called with a label and the completed fraction.

    Raises
    ------
    InputError
        If an argument is invalid.
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
        raise ParameterError(
            f"{name} needs exactly one measurement, not {len(measurements)}",
            name="measurements",
            value=str(len(measurements)),
            valid="one",
        )
    idle = [key for key in options if key.split(".")[0] in method.simulated]
    if measurements and idle:
        raise ParameterError(
            f"option {idle[0]} of {name} affects only simulated experiments. Remove it if you use "
            "measurement files",
            name=idle[0],
        )
    loss = {"loss": question.loss} if question.loss else {}
    return _with_parameters(method, _options(method, {**options, **loss}), parameters, overrides)


def _require_columns_alone(method: Method, question: Question) -> None:
    """Reject inputs of general methods, except columns for the method's signals.

    Raises
    ------
    InputError
        If there is any other input, or a signal that the method does not use.
    """
    noisy = any(question.noise.values())
    beyond = [name for name in question.given if name not in ("inputs", "outputs")]
    if beyond or noisy:
        raise ParameterError(
            f"{option(beyond[0] if beyond else 'outputs')}{'' if beyond else ' with a noise'} "
            f"applies only to methods that work with any bench ({', '.join(BENCH_METHODS.all())}). "
            f"Remove {'it' if beyond else 'the noise'} for {method.name}",
            name=option(beyond[0] if beyond else "outputs"),
        )
    signals = {**method.signals, **method.optional}
    reject_swapped("outputs", question.columns, signals)
    reject_swapped("inputs", question.inputs, signals)
    for name in (*question.inputs, *question.columns):
        if name not in signals:
            raise unknown_of_few(f"signal of {method.name}", name, signals)


def _columns_of(method: Method, question: Question, time: str) -> NamedColumns:
    """Return the columns of measurement files that a question lists.

    Parameters
    ----------
    method
        Method that uses the signals.
    question
        Columns of outputs and inputs.
    time
        Time column.

    Raises
    ------
    ParameterError
        If one name refers to two columns.
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
                f"{method.name} uses no parameters. Remove {option('parameters')} and "
                f"{option('overrides')}",
                name=option("parameters" if parameters else "overrides"),
            )
        return ChosenMethod(method, options)
    if method.bench is not None:
        bench = method.bench
        changes = parsed(type(bench.par), bench.overrides, "parameter")
        return ChosenMethod(method, options, bench.parameters, bench.par, changes)
    cited = set_for(f"method {method.name!r}", (method.assembly,), parameters)
    base = cited.parameters()
    for key in overrides:
        if key in options.flat() and key not in base.flat():
            raise unknown_name(
                f"parameter ({option('options')} sets the method's)", key, base.flat()
            )
    changes = parsed(type(base), settled(base, overrides), "parameter")
    return ChosenMethod(method, options, cited.name, base.replace(changes), changes)


def _options(method: Method, values: Mapping[str, Any]) -> ParameterSet:
    """Return a method's options with the user's changes."""
    try:
        given = parsed(method.options, values, f"option of {method.name}")
        return method.defaults.replace(given)
    except InputError as error:
        raise error.reworded(f"{error}. 'bywire list {method.name}' shows the options") from None


def _require_not_fitted(holdout: Source, measurements: Sequence[Source]) -> None:
    """Reject a held-out measurement that is also fitted, or that comes without a fitted one."""
    if not measurements:
        raise ParameterError(
            f"{option('holdout')} applies only to measurement files. Remove it",
            name=option("holdout"),
            value=str(holdout),
        )
    for fitted in measurements:
        if isinstance(holdout, xr.Dataset) or isinstance(fitted, xr.Dataset):
            if isinstance(fitted, xr.Dataset) and fitted is holdout:
                raise ParameterError(
                    f"{option('holdout')} is also a fitted record. Choose a record that is not "
                    "fitted",
                    name=option("holdout"),
                )
            continue
        try:
            equal = filecmp.cmp(fitted, holdout, shallow=False)
        except OSError:  # reading the file will report the error
            continue
        if equal:
            same = "is" if Path(fitted).samefile(holdout) else "has the same content as"
            raise ParameterError(
                f"{option('holdout')} {holdout} {same} {fitted}, a fitted record. Choose a record "
                "that is not fitted",
                name=option("holdout"),
                value=str(holdout),
            )


def _on_bench(
    method: BenchMethod,
    question: Question,
    changes: Mapping[str, Any],
    mapping: str | Path | None,
    time: str,
    progress: Progress,
) -> Method:
    """Return a general method for the question's bench."""
    if question.bench is None:
        raise ParameterError(
            f"{method.name} needs {option('bench')} with a bench file (TOML) or an experiment "
            "(see 'bywire list experiments')",
            name=option("bench"),
            valid="a bench file (TOML) or an experiment",
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
        named=_columns_of(on_bench, question, time),
        progress=progress,
    )
    return method.on(bench, replace(question, holdout=held.data))


# --- Identification

_STARTS = "starts.jsonl"
"""file in the output folder that stores finished starts"""

_FAR = 30.0  # factor above which a wrong unit is the likely cause


def identified(
    chosen: ChosenMethod,
    question: Question,
    sources: Sequence[Source],
    *,
    mapping: str | Path | None,
    time: str,
    synthetic: int | None,
    folder: Path | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> Identification:
    """Identify parameters from measurements or a simulated experiment (see `bywire.identify`)."""
    method = chosen.method
    named = _columns_of(method, question, time)
    _require_one_source(chosen, sources, synthetic, mapping, time)
    if folder is not None:
        require_own(folder, method.name)
    data, source = _data_of(chosen, sources, mapping, named, synthetic, progress)
    files = tuple(
        Path(each) for each in (*sources, question.holdout) if isinstance(each, str | Path)
    )
    if folder is not None:
        _remove(folder, files)
    start = _start_of(chosen, synthetic)
    store = None if folder is None else folder / _STARTS
    found = _search(
        chosen, start, data.data, Effort(starts=starts, seed=seed, store=store, progress=progress)
    )
    notes = [*data.notes]
    if chosen.par is not None:
        notes += _far_off(found.parameters, chosen.par.leaves())
    truth: Mapping[str, float] = {}
    if synthetic is not None:
        try:
            truth = put_in(method, chosen.par, chosen.options)
        except ParameterError as error:
            notes.append(str(error))
    return Identification(
        chosen,
        found,
        data.data,
        source,
        _begun_at(chosen, start, found),
        truth,
        tuple(notes),
        synthetic is not None,
        files,
    )


def _far_off(estimates: Mapping[str, float], before: Mapping[str, float]) -> list[str]:
    """Return a note on each parameter far from its earlier value, which suggests a wrong unit."""
    notes = []
    for name, value in estimates.items():
        known = before.get(name, 0.0)
        ratio = abs(value / known) if known else 1.0
        if ratio > _FAR or ratio * _FAR < 1.0:
            notes.append(
                f"{name} is {ratio:.3g} times its earlier value. Check the measurement's units "
                "('unit' "
                "in the map)"
            )
    return notes


def _require_one_source(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    synthetic: int | None,
    mapping: str | Path | None,
    time: str,
) -> None:
    """Require either measured or simulated data, with matching arguments.

    Raises
    ------
    ParameterError
        If an argument is missing or must be removed.
    """
    method = chosen.method
    study = f"{option('study') if is_command_line() else 'bywire.trust, with count'} COUNT"
    if sources and synthetic is not None:
        raise ParameterError(
            f"{method.name} accepts only one of these: measurement files, {option('synthetic')} "
            f"SEED, or {study}",
            name=option("synthetic"),
            valid=f"only one of these: measurement files, {option('synthetic')} SEED, or {study}",
        )
    if not sources and synthetic is None:
        signals = ", ".join(f"{n} [{unit}]" for n, unit in method.signals.items())
        raise ParameterError(
            f"{method.name} needs measurement files with the signals {signals}, "
            f"{option('synthetic')} SEED, or {study}",
            name=option("synthetic"),
            valid=f"measurement files with the signals {signals}",
        )
    for name, given in {"mapping": mapping is not None, "time": bool(time)}.items():
        if given and not sources:
            raise ParameterError(
                f"{option(name)} applies only to measurement files. Remove it", name=option(name)
            )


def _data_of(
    chosen: ChosenMethod,
    sources: Sequence[Source],
    mapping: str | Path | None,
    named: NamedColumns,
    synthetic: int | None,
    progress: Progress,
) -> tuple[Measured, str]:
    """Return the measurement and a line on its source."""
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


def _start_of(chosen: ChosenMethod, synthetic: int | None) -> ParameterSet | None:
    """Return the parameters from which the search starts, perturbed for simulated data."""
    if synthetic is None or chosen.par is None:
        return chosen.par
    return displaced(chosen.par, chosen.method.unknowns, Effort().spread, synthetic)


def _search(
    chosen: ChosenMethod, start: ParameterSet | None, data: xr.Dataset, effort: Effort
) -> Identified:
    """Run the method. If interrupted, report the file with the finished starts.

    Raises
    ------
    KeyboardInterrupt
        If interrupted.
    """
    require_signals(data, chosen.method.signals)
    try:
        return chosen.method.identify(data, start, chosen.options, effort)
    except KeyboardInterrupt:
        if effort.store is None or not effort.store.exists():
            raise
        raise KeyboardInterrupt(
            f"finished starts are saved in {effort.store}. Rerun the command to continue"
        ) from None


def _begun_at(
    chosen: ChosenMethod, start: ParameterSet | None, identified: Identified
) -> dict[str, float]:
    """Return the values from which the search started, by label."""
    if start is None:
        return {}
    if chosen.method.bench is None:
        return start.leaves()
    # If the range excludes the bench's value, the search starts elsewhere.
    return start.leaves() | {
        u.label: u.start for e in identified.estimates.values() for u in e.all_unknowns
    }


# --- The answer

_WITHOUT_EFFECT = re.compile(r"([\w.]+) = .* would have no effect")


def parameter_file(
    experiment: str,
    parameters: str,
    par: ParameterSet,
    changes: Mapping[str, Any],
    comment: str = "",
) -> str:
    """Return the text of a bench file with identified parameters.

    Parameters
    ----------
    experiment
        Experiment that the file runs. If it needs more than parameters, the file runs another
        experiment of the same assembly.
    parameters
        Name of the parameter set to change.
    par
        Parameters of this set, for their units.
    changes
        Dotted name -> value [SI] or choice. Changes without effect in the experiment become
        comments.
    comment
        First line.
    """
    wanted, left_out, problem = _accepted(experiment, parameters, changes)
    notes = comment.splitlines()
    if problem:
        for other in _alternatives(parameters):
            accepted, left, trouble = _accepted(other, parameters, changes)
            if not trouble:
                notes.append(
                    f"experiment {experiment!r} needs more than this file contains: {problem}"
                )
                experiment, wanted, left_out = other, accepted, left
                break
    lines = [f"# {line}" for line in notes]
    lines += [f'experiment = "{experiment}"', f'parameters = "{parameters}"', "", "[set]"]
    lines += [f'"{name}" = {_written(name, value, par)}' for name, value in wanted.items()]
    lines += [
        f"# without effect in this experiment: {name} = {_written(name, changes[name], par)}"
        for name in left_out
    ]
    return "\n".join(lines) + "\n"


def _accepted(
    experiment: str, parameters: str, changes: Mapping[str, Any]
) -> tuple[dict[str, Any], list[str], str]:
    """Return effective changes, names of the others, and why the bench is invalid, if so."""
    wanted: dict[str, Any] = dict(changes)
    left_out: list[str] = []
    while True:
        try:
            Bench(experiment, parameters, overrides=wanted)
        except InputError as error:
            refused = _WITHOUT_EFFECT.match(str(error))
            if refused is None or refused[1] not in wanted:
                return wanted, left_out, str(error).splitlines()[0]
            left_out.append(refused[1])
            wanted.pop(refused[1])
            continue
        return wanted, left_out, ""


def _alternatives(parameters: str) -> list[str]:
    """Return the experiments of a parameter set's assembly that need no stimulus section."""
    assembly = PARAMETER_SETS.find(parameters).assembly
    return [
        experiment.name
        for experiment in EXPERIMENTS.all().values()
        if experiment.tests(assembly) and experiment.driven_unit is None
    ]


def _written(name: str, value: Any, par: ParameterSet) -> str:
    leaf = leaf_fields(type(par)).get(name)
    if isinstance(value, bool):
        return str(value).lower()
    if leaf is None or isinstance(value, str):
        return f'"{value}"'
    unit = leaf.unit.symbol
    texts = [f'"{v:.9g} {unit}"' if unit != "1" else f"{v:.9g}" for v in _nodes(value)]
    return texts[0] if not isinstance(value, tuple) else f"[{', '.join(texts)}]"


def _nodes(value: Any) -> tuple[float, ...]:
    if isinstance(value, tuple):
        return tuple(map(float, value))
    return (float(value),)


# --- Earlier identifications and studies in the folder of ``--out``

_ESTIMATE = "estimate.json"
"""file in the output folder that lists the method and the other files"""

STUDY = "study.json"
"""file in the output folder with a study's method and results"""

_OURS = (".html", ".nc", ".png", ".toml")


def require_own(out: Path, method: str) -> None:
    """Reject a folder that contains a result or a study of another method.

    Raises
    ------
    FileError
        If there is such a result, or its files cannot be read.
    """
    for path, what in ((out / _ESTIMATE, "result"), (out / STUDY, "study")):
        earlier = _read(path)
        if earlier is None or earlier.get("method") == method:
            continue
        raise FileError(
            f"{out} contains a {what} of {earlier.get('method') or 'something else'}. For "
            f"{method}, "
            f"choose another folder with {option('folder')}, or remove {path} and its files",
            name=option("folder"),
            value=str(out),
        )


def remove_study(out: Path) -> None:
    """Remove an earlier study's result, but not its finished experiments.

    Raises
    ------
    FileError
        If the result cannot be removed.
    """
    _unlink(out / STUDY)


def _remove(out: Path, keep: Sequence[Path]) -> None:
    """Remove an earlier result's files, so that they do not mix with the new files.

    Parameters
    ----------
    out
        Folder of the results.
    keep
        Current measurement files, which must not be removed.

    Raises
    ------
    FileError
        If a file cannot be removed.
    """
    earlier = _read(out / _ESTIMATE)
    if earlier is None:
        return
    kept = {path.resolve() for path in keep}
    # The folder may have moved, so use only names within it. Remove the list itself last.
    names = [Path(str(text)).name for text in earlier.get("files", [])]
    written = [out / name for name in names if Path(name).suffix in _OURS]
    for path in (*written, out / _ESTIMATE):
        if path.resolve() not in kept:
            _unlink(path)


def _unlink(path: Path) -> None:
    try:
        if path.is_file():
            path.unlink()
    except OSError as error:
        raise FileError(
            f"cannot remove {path} of an earlier result: {error.strerror}. Choose another folder "
            f"with {option('folder')}",
            name=str(path),
        ) from None


def _read(path: Path) -> dict[str, Any] | None:
    """Read an earlier result. Return None if there is none."""
    if not path.exists():
        return None
    try:
        earlier = json.loads(path.read_text(encoding="utf-8"))
        if not (isinstance(earlier, dict) and isinstance(earlier.get("files", []), list)):
            raise ValueError("it is not a result of bywire identify")
    except (OSError, ValueError) as error:
        raise FileError(
            f"cannot read {path} ({error}). Choose another folder with {option('folder')}, or "
            "remove this file",
            name=str(path),
        ) from None
    return earlier


# --- The answer


@dataclass(frozen=True)
class Identification(Answer):
    """Result of an identification, with its inputs.

    Parameters
    ----------
    chosen
        Method with its parameters and options.
    identified
        Result of the method.
    data
        Measurement over ``time`` [s].
    source
        Description of the measurement in one line.
    start
        Values [SI] from which the search started, by the estimates' labels.
    put_in
        True values of a simulated measurement by the same labels. Empty for a real measurement.
    data_notes
        Notes on how bywire processed the measurement, and on doubtful data.
    is_simulated
        Whether the measurement is simulated. If so, it is written with the result.
    files
        Measurement files, which remain if an earlier result is removed.
    """

    chosen: ChosenMethod
    identified: Identified
    data: xr.Dataset
    source: str
    start: Mapping[str, float] = field(default_factory=dict)
    put_in: Mapping[str, float] = field(default_factory=dict)
    data_notes: tuple[str, ...] = ()
    is_simulated: bool = False
    files: tuple[Path, ...] = ()

    @property
    def parameters(self) -> dict[str, float]:
        """Identified parameters [SI] by dotted name, as overrides for a bench."""
        return dict(self.identified.parameters)

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Estimates with their covariance, by subject."""
        return dict(self.identified.estimates)

    @property
    def notes(self) -> list[str]:
        """Notes on how bywire processed the measurement, and on doubtful data."""
        return list(self.data_notes)

    @property
    def failures(self) -> list[str]:
        """Failed checks, with their meaning."""
        return [
            f"check failed: {check.name}: {check.note}"
            + (f". Next step: {check.next_step}" if check.next_step else "")
            for check in self.identified.checks
            if not check.holds
        ]

    @property
    def holds(self) -> bool:
        """Whether every check passed."""
        return not self.failures

    @property
    def outcome(self) -> Outcome:
        """Verdict on the checks; ``not shown`` if the method has none."""
        return outcome_of(["met" if each.holds else "missed" for each in self.identified.checks])

    def bench_file(self) -> str:
        """Return a bench file with the identified parameters, headed by failed checks.

        The text is empty if there are no usable parameters of an assembly.
        """
        method, par = self.chosen.method, self.chosen.par
        if par is None or not self.identified.parameters:
            return ""
        lines = [
            f"CHECK FAILED, do not use this file: {c.name} = {c.value:.4g} "
            f"(limit {'>=' if c.at_least else '<='} {c.limit:g}): {c.note}"
            for c in self.identified.checks
            if not c.holds
        ]
        lines.append(f"identified with {method.name} from {self.source}")
        for estimate in self.identified.estimates.values():
            lines += [f"not determined by the data: {k.unknown.label}" for k in estimate.kept]
            lines += [f"at its bound: {label}" for label in estimate.at_bounds()]
        comment = "\n".join([*lines, *([method.bench_note] if method.bench_note else [])])
        if method.bench is not None:
            from bywire.bench.bench_file import bench_text

            return bench_text(method.bench.with_overrides(self.identified.parameters), comment)
        changes = {**self.chosen.changes, **self.identified.parameters}
        return parameter_file(method.experiment, self.chosen.name, par, changes, comment)

    def document(self) -> Document:
        """Return parameters, checks, curves, residuals, correlations and settings."""
        method, subject = self.chosen.method, self.chosen.subject
        head = f"{method.name}, {self.source}: {method.summary}"
        return Document(
            f"Identification {method.name}",
            method.summary if subject is None else subject.line,
            sections=lambda: self._sections(subject),
            brief=spaced([head, *self._parameters()]),
            data=self._data(),
            banner=self._banner(),
            attachments=list(self._attachments()),
            record=_ESTIMATE,
            file_notes=self._file_notes(),
            prepare=self._prepare,
            changes=self.chosen.changed,
        )

    def _sections(self, subject: Subject | None) -> list[Section]:
        from bywire.report.estimate_figures import method_curve

        curves = [
            FigureBlock(partial(method_curve, curve), curve.caption, curve.name)
            for curve in self.identified.curves
        ]
        data: list[Block] = [Paragraph(f"Measurement: {self.source}.")]
        return [
            Section("Parameters", list(self._parameters())),
            *([Section("Curves", curves)] if curves else []),
            Section("Residuals", self._residuals()),
            Section("Correlations", self._correlations()),
            Section("Data", [*data, *([Listing(self.data_notes)] if self.data_notes else [])]),
            self._made(subject),
        ]

    def _parameters(self) -> Iterator[Flat]:
        for name, estimate in self.identified.estimates.items():
            table = estimate_table(estimate, self.start, self.put_in)
            texts = [
                f"{k.unknown.label} is not determined by the data: {k.reason}"
                for k in estimate.kept
            ]
            yield TableBlock(table, f"{name[:1].upper()}{name[1:]}.", title=name)
            if texts or estimate.notes:
                yield Listing([*texts, *estimate.notes])
        if self.identified.figures:
            yield TableBlock(figure_table(self.identified), "Additional results.")
        if self.identified.checks:
            yield TableBlock(check_table(self.identified.checks), "Checks.")
        if self.identified.notes:
            yield Listing(self.identified.notes)

    def _residuals(self) -> list[Block]:
        from bywire.report.estimate_figures import residual_figure

        return [
            FigureBlock(partial(residual_figure, estimate), _residual_caption(name, estimate), key)
            for key, name, estimate in self._keyed("residuals")
            if estimate.residuals.size > 1
        ]

    def _correlations(self) -> list[Block]:
        from bywire.report.estimate_figures import correlation_matrix

        blocks: list[Block] = [
            FigureBlock(
                partial(correlation_matrix, estimate),
                f"{name}: correlations of the estimates. Near 1 or -1, the data determine only a "
                "combination of the two unknowns.",
                key,
            )
            for key, name, estimate in self._keyed("correlation")
            if len(estimate.unknowns) > 1
        ]
        return blocks or [Paragraph("A single unknown has no correlations.")]

    def _keyed(self, kind: str) -> Iterator[tuple[str, str, Estimate]]:
        """Yield a figure's file name, an estimate's capitalized name, and the estimate."""
        several = len(self.identified.estimates) > 1
        for k, (name, estimate) in enumerate(self.identified.estimates.items(), 1):
            yield f"{kind}-{k}" if several else kind, f"{name[:1].upper()}{name[1:]}", estimate

    def _made(self, subject: Subject | None) -> Section:
        method, options = self.chosen.method, self.chosen.options
        idle = () if self.is_simulated else method.simulated
        rows = [r for r in parameter_rows(options) if r.name.split(".")[0] not in idle]
        chosen = Details("Method options", [TableBlock(parameter_table(rows))])
        if subject is None:
            changed = changes_block(self.chosen.changed, "", method.name)
            return Section("Settings", [Paragraph(method.summary), changed, chosen])
        section = subject.provenance(f"Method {method.name}: {method.summary}.")
        return Section(section.title, [*section.blocks, chosen])

    def _banner(self) -> Banner:
        failed = [check.name for check in self.identified.checks if not check.holds]
        undetermined = [k.unknown.label for e in self.identified.estimates.values() for k in e.kept]
        if failed:
            return Banner(f"Do not use this result: {', '.join(failed)} failed.", "bad")
        if undetermined:
            names = ", ".join(undetermined)
            return Banner(f"All checks passed. Not determined by the data: {names}.", "none")
        return Banner("All checks passed.", "good")

    def _data(self) -> dict[str, Any]:
        method, identified = self.chosen.method, self.identified
        idle = set() if self.is_simulated else set(method.simulated)
        return {
            "method": method.name,
            "parameter_set": None if self.chosen.par is None else self.chosen.name,
            "measurement": self.source,
            "options": self.chosen.options.model_dump(mode="json", exclude=idle),
            "parameters": dict(identified.parameters),
            "estimates": {name: as_object(e) for name, e in identified.estimates.items()},
            "start": self._of_estimates(self.start),
            "put_in": self._of_estimates(self.put_in),
            "figures": {
                name: {"value": value, "unit": unit}
                for name, (value, unit) in identified.figures.items()
            },
            "checks": [
                {
                    "name": c.name,
                    "value": c.value,
                    "unit": c.unit,
                    "limit": c.limit,
                    "at_least": c.at_least,
                    "holds": c.holds,
                    "note": c.note,
                    "next_step": c.next_step,
                }
                for c in identified.checks
            ],
            "notes": [*self.data_notes, *identified.notes],
        }

    def _of_estimates(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values of all unknowns, including those that were not estimated."""
        labels = [u.label for e in self.identified.estimates.values() for u in e.all_unknowns]
        return {label: values[label] for label in labels if label in values}

    def _attachments(self) -> Iterator[Attachment]:
        if self.is_simulated:
            yield Attachment("measurement.nc", self._write_data)
        if text := self.bench_file():
            yield Attachment("parameters.toml", partial(_write_text, text), after_record=True)

    def _write_data(self, path: Path) -> Path:
        from bywire.data.writing import write_measurement

        return write_measurement(self.data, path, overwrite=True)

    def _file_notes(self) -> list[str]:
        """Return a note about the bench file, or the reason why there is none."""
        method = self.chosen.method
        if self.identified.parameters and self.chosen.par is not None:
            return [f"parameters.toml: {method.bench_note}"] if method.bench_note else []
        asked = self.chosen.par is not None and method.unknowns
        reason = (
            "no estimate is usable"
            if asked
            else f"{method.name} does not identify parameters of an assembly. Its results are in "
            "estimate.json"
        )
        return [f"no parameters.toml: {reason}"]

    def _prepare(self, folder: Path) -> None:
        require_own(folder, self.chosen.method.name)
        _remove(folder, self.files)


def _residual_caption(name: str, estimate: Estimate) -> str:
    follows = (
        "Neighboring residuals are correlated. The model's errors last longer than a sample, and "
        "the intervals account for this"
        if estimate.colored
        else "Neighboring residuals are independent, as expected for noise"
    )
    return (
        f"{name}: residuals of {estimate.residuals.size} measured values, root mean square "
        f"{estimate.rms:.3g}. {follows}."
    )


def _write_text(text: str, path: Path) -> Path:
    from bywire.report.drawing import write_bytes

    return write_bytes(path, text.encode())
