"""``bywire design``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from bywire.api.loop_case import loop_case, over_range
from bywire.cli import output
from bywire.cli.design_ending import exit_status, reported, written
from bywire.cli.design_inputs import (
    Wanted,
    left_to_choose,
    requirements_of,
    trial_of,
    tunables_of,
)
from bywire.cli.design_text import as_object, as_parts
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.cli.verification_text import as_lines
from bywire.core.units import shown
from bywire.synthesis.designer import design
from bywire.synthesis.linear_case import cases_of
from bywire.synthesis.verification import Verification, verify


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    wanted: Wanted,
    out: Path | None,
    as_json: bool,
) -> int:
    """Choose gains for a loop and return the exit status: 1 where requirements are not met."""
    if out is not None:
        require_folder(out)
    if wanted.schedule:
        from bywire.cli import schedule_design

        return schedule_design.execute(loop, parameters, at, changes, wanted, out, as_json)
    chosen = loop_case(loop, parameters, at, changes)
    requirements = requirements_of(wanted)
    tunables = left_to_choose(loop, tunables_of(chosen), changes)
    ranges = dict(over_range(text, chosen)[::2] for text in wanted.over)
    cases = cases_of(chosen.loop, chosen.par, chosen.value, ranges)
    trial = trial_of(chosen, changes, wanted)
    start = {name: chosen.par.leaves()[name] for name in tunables}
    tried: Verification | None = None
    with progress_bar() as progress:
        found = design(
            tunables, requirements, cases, start, seed=wanted.seed, progress=progress
        )  # fmt: skip
        if trial is not None and found.status == "met":
            tried = verify(
                found.gains, requirements, tunables, cases, trial, seed=wanted.seed,
                progress=progress,
            )  # fmt: skip
    files: list[Path] = []
    if out is not None:
        gains = found.gains if tried is None else tried.final.gains
        point = shown(chosen.value, chosen.loop.at.unit)
        files = [written(chosen, changes, gains, (found.status, tried), point, out)]
        parts = as_parts(chosen, requirements, found, tried)
        files += reported(
            chosen, requirements, (found.status, tried), {"linear design": found.gains}, parts, out
        )
    if as_json:
        output.result(json.dumps(as_object(chosen, requirements, found, tried, files)))
    else:
        output.result(as_lines(as_parts(chosen, requirements, found, tried)))
    for path in files:
        output.message(f"written: {path}")
    return exit_status(found.status, tried)
