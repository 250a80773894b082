"""``bywire identify``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.cli import earlier_result, output
from bywire.cli.identified_bench import bench_notes, bench_text, far_off
from bywire.cli.identify_text import as_object, text
from bywire.cli.method_choice import Chosen, Wanted, choose
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import InputError, ParameterError

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.identification.measured import Measured
    from bywire.identification.method import Identified, Progress
    from bywire.report.identification_report import Identification

STARTS = "starts.jsonl"
"""file of the output folder that keeps finished starts"""


def execute(name: str, wanted: Wanted, out: Path | None, as_json: bool) -> int:
    """Identify parameters and return the exit status: 1 when a check fails."""
    chosen = choose(name, wanted)
    if out is not None:
        require_folder(out)
        earlier_result.require_own(out, chosen.method.name)
    if wanted.study is not None:
        from bywire.cli.identify_study import study

        return study(chosen, wanted, out, as_json)
    with progress_bar() as progress:
        measured, source = _measured(chosen, wanted, progress)
        if out is not None:
            earlier_result.remove(out, wanted.files)
        start = _start(chosen, wanted)
        found = _identified(chosen, start, measured, wanted, out, progress)
    one = _assembled(chosen, start, found, measured, source, wanted)
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


def _measured(chosen: Chosen, wanted: Wanted, progress: Progress) -> tuple[Measured, str]:
    from bywire.identification.measured import Measured, measured

    method = chosen.method
    if wanted.synthetic is None:
        found = measured(
            wanted.measurements, wanted.mapping, method.signals,
            optional=method.optional, gaps=method.gaps, progress=progress,
            multiple=None if method.bench is None else method.bench.step,
        )  # fmt: skip
        return found, ", ".join(path.name for path in wanted.measurements)
    progress("simulated experiment", 0.0)
    data = method.synthetic(chosen.par, chosen.options, wanted.synthetic)
    progress("simulated experiment", 1.0)
    made_of = f" of {chosen.name}" if chosen.name else ""
    return Measured(data, ()), f"simulated experiment{made_of}, seed {wanted.synthetic}"


def _start(chosen: Chosen, wanted: Wanted) -> ParameterSet | None:
    """Return the parameters from which the search begins: off those that were put in."""
    from bywire.identification.method import Effort
    from bywire.identification.simulated_experiments import displaced

    if wanted.synthetic is None or chosen.par is None:
        return chosen.par
    return displaced(chosen.par, chosen.method.unknowns, Effort().spread, wanted.synthetic)


def _identified(
    chosen: Chosen, start: ParameterSet | None, measured: Measured, wanted: Wanted,
    out: Path | None, progress: Progress,
) -> Identified:  # fmt: skip
    from bywire.identification.method import Effort

    method = chosen.method
    store = None if out is None else out / STARTS
    effort = Effort(starts=wanted.starts, seed=wanted.seed, store=store, progress=progress)
    method.require_signals(measured.data)
    try:
        return method.identify(measured.data, start, chosen.options, effort)
    except KeyboardInterrupt:
        if store is not None and store.exists():
            output.message(f"finished starts are in {store}: the same command goes on from there")
        raise


def _assembled(
    chosen: Chosen, start: ParameterSet | None, found: Identified, measured: Measured, source: str,
    wanted: Wanted,
) -> Identification:  # fmt: skip
    from bywire.identification.put_in import put_in
    from bywire.report.identification_report import Identification
    from bywire.report.subject import Subject

    subject, notes = None, list(measured.notes)
    if chosen.par is not None:
        subject = Subject(
            chosen.method.name, chosen.method.summary, chosen.name, chosen.par
        )
        notes += far_off(found.parameters, subject.par.leaves())
    idle: Sequence[str] = chosen.method.simulated
    truth: Mapping[str, float] = {}
    if wanted.synthetic is not None:
        idle = ()
        try:
            truth = put_in(chosen.method, chosen.par, chosen.options)
        except ParameterError as error:
            notes.append(str(error))
    return Identification(
        chosen.method, chosen.options, found, source, notes, subject, idle,
        start=_begun_at(chosen, start, found), put_in=truth,
    )  # fmt: skip


def _begun_at(chosen: Chosen, start: ParameterSet | None, found: Identified) -> dict[str, float]:
    """Return the values from which the search began, by label."""
    if start is None:
        return {}
    if chosen.method.bench is None:
        return start.leaves()
    # A range that leaves out the bench's own value begins elsewhere.
    own = {u.label: u.start for e in found.estimates.values()
           for u in (*e.unknowns, *(k.unknown for k in e.kept))}  # fmt: skip
    return start.leaves() | own


def _written(
    chosen: Chosen, wanted: Wanted, one: Identification, measured: Measured, out: Path | None
) -> tuple[list[Path], InputError | None]:
    """Write everything that was found; a full disk must not cost the numbers too."""
    if out is None:
        return [], None
    from bywire.report.files import write_bytes
    from bywire.report.identification_report import write_identification

    files: list[Path] = []
    estimate = out / earlier_result.ESTIMATE

    def listed(more: Sequence[Path]) -> Path:
        text = json.dumps(as_object(one, [*files, *more, estimate]), indent=1) + "\n"
        return write_bytes(estimate, text.encode())

    try:
        if wanted.synthetic is not None:
            from bywire.data.writing import write_measurement

            files.append(write_measurement(measured.data, out / "measurement.nc", overwrite=True))
        if one.found.parameters and chosen.par is not None:
            parameters = out / "parameters.toml"
            # Interrupted from here on, values lie beside the checks that say what they are worth.
            listed([parameters])
            bench = bench_text(one, chosen.par, chosen.changes)
            files.append(write_bytes(parameters, bench.encode()))
        files += write_identification(out, one)
        files.append(listed([]))
    except InputError as error:
        return files, error
    except KeyboardInterrupt:
        output.message(f"the report in {out} is not complete: the same command writes it")
        raise
    return files, None
