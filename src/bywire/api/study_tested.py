"""What a study tests: its bench with changes, options and faults, as its report and JSON say it."""

from __future__ import annotations

import math
from typing import Any

from bywire.api.run_changes import option_changes, parameter_changes
from bywire.api.run_remarks import change_texts, fault_texts
from bywire.api.run_sections import options_in_use, what_was_changed
from bywire.bench.bench import Bench
from bywire.bench.result import Result
from bywire.report.document import Block, Listing, Paragraph, Section
from bywire.report.wording import clean
from bywire.studies.plan import StudyPlan
from bywire.studies.studied_bench import StudiedBench


def tested_line(plan: StudyPlan) -> str:
    """Return what the bench of a study does in one line, with the faults that it has."""
    line = plan.bench.summary([each.name for each in plan.varied])
    names = [fault.mode.name for fault in plan.bench.injections]
    if not names:
        return line
    return f"{line}, with the fault{'s' * (len(names) > 1)} {', '.join(names)}"


def tested_brief(nominal: Result) -> list[Listing]:
    """Return for a terminal what is changed of the parameters, and the faults, if there are any."""
    said = [*change_texts(nominal.bench), *fault_texts(nominal)]
    return [Listing(said)] if said else []


def tested_section(nominal: Result, source: StudiedBench | None) -> Section:
    """Return where the bench comes from, its faults, what it changes, and its options.

    Parameters
    ----------
    nominal
        The bench itself, run.
    source
        Where it comes from; None where that is not known.
    """
    faults = fault_texts(nominal)
    blocks: list[Block] = [Paragraph(f"{_source_text(source)}.")] if source is not None else []
    blocks += [Listing(faults)] if faults else []
    blocks += [what_was_changed(nominal.bench), options_in_use(nominal.bench)]
    return Section("What was tested", blocks)


def tested_data(bench: Bench, source: StudiedBench | None) -> dict[str, Any]:
    """Return the bench for JSON.

    Values are SI numbers, those of changes and of what the study sets texts with units; the end of
    a fault that stays is None.
    """
    changes = parameter_changes(bench) + option_changes(bench)
    return {
        "file": None if source is None else source.bench,
        "set": {} if source is None else dict(source.changes),
        "experiment": bench.experiment,
        "parameters": bench.parameters,
        "changes": {
            each.name: {"value": each.now, "instead_of": each.before} for each in changes
        },
        "options": bench.chosen_options.model_dump(mode="json"),
        "faults": [
            {
                "fault": fault.mode.name, "summary": fault.mode.summary,
                "value": fault.value if fault.mode.unit else None, "unit": fault.mode.unit or None,
                "onset": fault.course.onset,
                "end": fault.course.end if math.isfinite(fault.course.end) else None,
            }
            for fault in bench.injections
        ],
    }  # fmt: skip


def _source_text(source: StudiedBench) -> str:
    """Return which bench the study file names, and what the study sets of it."""
    changes = ", ".join(f"{name} = {value}" for name, value in source.changes.items())
    return clean(f"Bench: {source.bench}" + (f", of which the study sets {changes}" if changes
                                             else ""))  # fmt: skip
