"""What a study tests: its bench with changes, options and faults, as its report and JSON say it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from bywire.api.run_remarks import fault_texts
from bywire.api.run_sections import options_in_use
from bywire.bench.bench import Bench
from bywire.bench.result import Result
from bywire.report.document import Block, Listing, Paragraph, Section
from bywire.report.subject import Subject, bench_changes
from bywire.report.wording import clean
from bywire.studies.plan import StudiedBench, StudyPlan, Varied


def tested_line(plan: StudyPlan) -> str:
    """Return what the bench of a study does in one line, with the faults that it has."""
    line = plan.bench.summary([each.name for each in plan.varied])
    names = [fault.mode.name for fault in plan.bench.injections]
    if not names:
        return line
    return f"{line}, with the fault{'s' * (len(names) > 1)} {', '.join(names)}"


def tested_brief(nominal: Result, plan: StudyPlan) -> list[Listing]:
    """Return for a terminal the faults, if there are any, and what varies."""
    return [Listing([*fault_texts(nominal.bench, nominal.recordings), *varied_texts(plan.varied)])]


def varied_texts(varied: Sequence[Varied]) -> list[str]:
    """Return a sentence on each quantity that takes several values."""
    return [clean(f"{each.name} varies: {each.distribution.text}") for each in varied]


def tested_section(nominal: Result, source: StudiedBench | None, subject: Subject) -> Section:
    """Return where the bench comes from, its faults, what it changes, and its options.

    Parameters
    ----------
    nominal
        The bench itself, run.
    source
        Where it comes from; None where that is not known.
    subject
        The bench with what was changed of it.
    """
    faults = fault_texts(nominal.bench, nominal.recordings)
    blocks: list[Block] = [Paragraph(f"{_source_text(source)}.")] if source is not None else []
    blocks += [Listing(faults)] if faults else []
    blocks += [subject.changes_block, options_in_use(nominal.bench)]
    return Section("What was tested", blocks)


def tested_data(bench: Bench, source: StudiedBench | None) -> dict[str, Any]:
    """Return the bench for JSON.

    Values are SI numbers, those of changes and of what the study sets texts with units; the end of
    a fault that stays is None.
    """
    return {
        "file": None if source is None else source.bench,
        "set": {} if source is None else dict(source.changes),
        "experiment": bench.experiment,
        "parameters": bench.parameters,
        "changes": {
            each.name: {"value": each.now, "instead_of": each.before}
            for each in bench_changes(bench)
        },
        "options": bench.chosen_options.model_dump(mode="json"),
        "faults": [
            {
                "fault": fault.mode.name,
                "summary": fault.mode.summary,
                "value": fault.value if fault.mode.unit else None,
                "unit": fault.mode.unit or None,
                "onset": fault.course.onset,
                "end": fault.course.end if math.isfinite(fault.course.end) else None,
            }
            for fault in bench.injections
        ],
    }


def _source_text(source: StudiedBench) -> str:
    """Return which bench the study file names, and what the study sets of it."""
    changes = ", ".join(f"{name} = {value}" for name, value in source.changes.items())
    return clean(
        f"Bench: {source.bench}" + (f", of which the study sets {changes}" if changes else "")
    )
