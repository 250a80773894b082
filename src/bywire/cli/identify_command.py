"""``bywire identify``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.cli import earlier_result, output
from bywire.cli.identified_bench import bench_notes, bench_text, far_off
from bywire.cli.identify_text import as_object, text
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import InputError, ParameterError, unknown_name

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.identification.measured import Measured
    from bywire.identification.method import Method, Progress
    from bywire.report.identification_report import Identification

STARTS = "starts.jsonl"
"""file of the output folder that keeps finished starts"""


@dataclass(frozen=True)
class Wanted:
    """What is to be identified, and how; texts as on the command line."""

    measurements: Sequence[Path]
    mapping: Path | None
    parameters: str
    changes: Mapping[str, str]
    options: Mapping[str, str]
    starts: int
    seed: int
    synthetic: int | None
    study: int | None


@dataclass(frozen=True)
class Chosen:
    """The method with its parameters and options; no parameters where it needs none."""

    method: Method
    name: str
    par: ParameterSet | None
    options: ParameterSet


def execute(name: str, wanted: Wanted, out: Path | None, as_json: bool) -> int:
    """Identify parameters and return the exit status: 1 when a check fails."""
    from bywire.identification.method_registry import find_method

    method = find_method(name)
    _require_one_source(method, wanted)
    chosen = _chosen(method, wanted)
    if out is not None:
        require_folder(out)
        earlier_result.require_own(out, method.name)
    if wanted.study is not None:
        from bywire.cli.identify_study import study

        return study(chosen, wanted, out, as_json)
    with progress_bar() as progress:
        measured, source = _measured(chosen, wanted, progress)
        if out is not None:
            earlier_result.remove(out, wanted.measurements)
        found = _identified(chosen, measured, wanted, out, progress)
    one = _assembled(chosen, found, measured, source, wanted)
    files, trouble = _written(chosen, wanted, one, measured, out)
    for note in (*one.notes, *([] if out is None else bench_notes(one))):
        output.message(f"note: {note}")
    output.result(json.dumps(as_object(one, files)) if as_json else text(one))
    for check in one.found.checks:
        if not check.holds:
            output.message(f"check failed: {check.name}: {check.note}")
    if trouble is not None:
        raise trouble
    if out is not None:
        output.message(f"report: {out / 'report.html'}")
    return 0 if one.holds else 1


def _require_one_source(method: Method, wanted: Wanted) -> None:
    sources = [bool(wanted.measurements), wanted.synthetic is not None, wanted.study is not None]
    if sum(sources) > 1:
        raise ParameterError(
            f"{method.name}: give only one of measurement files, --synthetic SEED, --study COUNT"
        )
    if sum(sources) < 1:
        signals = ", ".join(f"{n} [{unit}]" for n, unit in method.signals.items())
        raise ParameterError(
            f"{method.name} needs one of: measurement files with the signals {signals}, "
            "--synthetic SEED, or --study COUNT"
        )
    if len(wanted.measurements) > 1 and not method.several:
        raise ParameterError(f"{method.name} takes one measurement, not {len(wanted.measurements)}")
    if wanted.mapping is not None and not wanted.measurements:
        raise ParameterError("--map is for measurement files: leave it out")


def _chosen(method: Method, wanted: Wanted) -> Chosen:
    from bywire.bench.values import parsed
    from bywire.catalog.registry import entry, main_set

    given = parsed(method.options, wanted.options, f"option of {method.name}")
    idle = [name for name in wanted.options if name.split(".")[0] in method.simulated]
    if wanted.measurements and idle:
        raise ParameterError(
            f"option {idle[0]} of {method.name} only shapes simulated experiments: leave it out "
            "for measurement files"
        )
    options = method.defaults.replace(given)
    if not method.assembly:
        if wanted.parameters or wanted.changes:
            raise ParameterError(
                f"{method.name} needs no parameters: leave out --parameters and --set"
            )
        return Chosen(method, "", None, options)
    found = entry(wanted.parameters or main_set(method.assembly))
    if found.assembly != method.assembly:
        raise ParameterError(
            f"method {method.name!r} is for a {method.assembly}, but parameter set "
            f"{found.name!r} is for a {found.assembly}"
        )
    base = found.parameters()
    for name in wanted.changes:
        if name in options.flat() and name not in base.flat():
            raise unknown_name("parameter (--option sets the method's)", name, base.flat())
    par = base.replace(parsed(type(base), wanted.changes, "parameter"))
    return Chosen(method, found.name, par, options)


def _measured(chosen: Chosen, wanted: Wanted, progress: Progress) -> tuple[Measured, str]:
    from bywire.identification.measured import Measured, measured

    method = chosen.method
    if wanted.synthetic is None:
        found = measured(
            wanted.measurements, wanted.mapping, method.signals,
            optional=method.optional, gaps=method.gaps, progress=progress,
        )  # fmt: skip
        return found, ", ".join(path.name for path in wanted.measurements)
    progress("simulated experiment", 0.0)
    data = method.synthetic(chosen.par, chosen.options, wanted.synthetic)
    progress("simulated experiment", 1.0)
    made_of = f" of {chosen.name}" if chosen.name else ""
    return Measured(data, ()), f"simulated experiment{made_of}, seed {wanted.synthetic}"


def _identified(
    chosen: Chosen, measured: Measured, wanted: Wanted, out: Path | None, progress: Progress
) -> Any:
    from bywire.identification.method import Effort
    from bywire.identification.simulated_experiments import displaced

    method, par = chosen.method, chosen.par
    store = None if out is None else out / STARTS
    effort = Effort(starts=wanted.starts, seed=wanted.seed, store=store, progress=progress)
    if wanted.synthetic is not None and par is not None:
        par = displaced(par, method.unknowns, effort.spread, wanted.synthetic)
    method.require_signals(measured.data)
    try:
        return method.identify(measured.data, par, chosen.options, effort)
    except KeyboardInterrupt:
        if store is not None and store.exists():
            output.message(f"finished starts are in {store}: the same command goes on from there")
        raise


def _assembled(
    chosen: Chosen, found: Any, measured: Measured, source: str, wanted: Wanted
) -> Identification:
    from bywire.report.identification_report import Identification
    from bywire.report.subject import Subject

    subject, notes = None, list(measured.notes)
    if chosen.par is not None:
        subject = Subject(
            chosen.method.name, chosen.method.summary, chosen.name, chosen.par
        )
        notes += far_off(found.parameters, subject.par.leaves())
    idle = () if wanted.synthetic is not None else chosen.method.simulated
    return Identification(chosen.method, chosen.options, found, source, notes, subject, idle)


def _written(
    chosen: Chosen, wanted: Wanted, one: Identification, measured: Measured, out: Path | None
) -> tuple[list[Path], InputError | None]:
    """Write everything that was found; a full disk must not cost the numbers too."""
    if out is None:
        return [], None
    from bywire.bench.values import parsed
    from bywire.report.files import write_bytes
    from bywire.report.identification_report import write_identification

    files: list[Path] = []
    try:
        if wanted.synthetic is not None:
            from bywire.data.writing import write_measurement

            files.append(write_measurement(measured.data, out / "measurement.nc", overwrite=True))
        if one.found.parameters and chosen.par is not None:
            changes = parsed(type(chosen.par), wanted.changes, "parameter")
            bench = bench_text(one, chosen.par, changes)
            files.append(write_bytes(out / "parameters.toml", bench.encode()))
        files += write_identification(out, one)
        shown = json.dumps(as_object(one, [*files, out / earlier_result.ESTIMATE]), indent=1) + "\n"
        files.append(write_bytes(out / earlier_result.ESTIMATE, shown.encode()))
    except InputError as error:
        return files, error
    return files, None
