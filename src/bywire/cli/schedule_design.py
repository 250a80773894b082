"""``bywire design --schedule``: gains by region of the operating point."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from bywire.analysis.loop import LOOPS
from bywire.api.loop_case import loop_case, over_range, spread
from bywire.cli import output
from bywire.cli.design_ending import exit_status, reported, written
from bywire.cli.design_inputs import Wanted, requirements_of, trial_of
from bywire.cli.progress import progress_bar
from bywire.cli.schedule_text import as_object, as_parts
from bywire.cli.verification_text import as_lines
from bywire.core.units import shown
from bywire.synthesis.schedule_designer import (
    design_schedule,
    frozen,
    points_by_region,
    scheduled,
)
from bywire.synthesis.schedule_verification import verify_schedule
from bywire.synthesis.verification import Verification


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    wanted: Wanted,
    out: Path | None,
    as_json: bool,
) -> int:
    """Design a gain schedule and return the exit status: 1 where requirements are not met."""
    own = LOOPS.find(loop)
    schedule = scheduled(own)
    changes = {**changes, **schedule.changes}
    chosen = loop_case(loop, parameters, "", changes)
    given = spread(at, own.at.unit, own.at.name) if at else []
    points = points_by_region(own, chosen.par, given)
    chosen = replace(chosen, value=points[schedule.main][0])
    requirements = requirements_of(wanted)
    tunables = {
        region: {name: span for name, span in spans.items() if name not in changes}
        for region, spans in schedule.regions.items()
    }
    ranges = dict(over_range(text, chosen)[::2] for text in wanted.over)
    trial = trial_of(chosen, changes, wanted)
    tried: Verification | None = None
    with progress_bar() as progress:
        found = design_schedule(
            own, chosen.par, requirements, points, tunables, over=ranges, seed=wanted.seed,
            progress=progress,
        )  # fmt: skip
        if trial is not None and found.status == "met":
            tried = verify_schedule(
                found, requirements, tunables, trial, seed=wanted.seed, progress=progress
            )
    files: list[Path] = []
    every = [one for values in points.values() for one in values]
    retuned = (
        frozen(own, chosen.par, every, tried.final.gains, requirements)
        if tried is not None and tried.tuning is not None else ()
    )  # fmt: skip
    parts = as_parts(chosen, found, tried, retuned)
    if out is not None:
        gains = found.gains if tried is None else tried.final.gains
        where = ", ".join(shown(one, own.at.unit) for one in every)
        files = [written(chosen, changes, gains, (found.status, tried), where, out)]
        files += reported(
            chosen, requirements, (found.status, tried), {"linear design": found.gains}, parts, out
        )
    if as_json:
        output.result(json.dumps(as_object(chosen, requirements, found, tried, retuned, files)))
    else:
        output.result(as_lines(parts))
    for path in files:
        output.message(f"written: {path}")
    return exit_status(found.status, tried)
