"""``bywire identify METHOD --study``: whether what is put in comes back."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.cli import earlier_result, output
from bywire.cli.identify_text import finite
from bywire.cli.progress import progress_bar

if TYPE_CHECKING:
    from bywire.cli.method_choice import Chosen, Wanted
    from bywire.identification.trust import Trust

STORE = "experiments.jsonl"
"""file of the output folder that keeps finished experiments"""


def study(chosen: Chosen, wanted: Wanted, out: Path | None, as_json: bool) -> int:
    """Identify many simulated experiments and return the exit status."""
    from bywire.identification.method import Effort
    from bywire.identification.trust import trust
    from bywire.report.files import write_bytes

    assert wanted.study is not None
    store = None if out is None else out / STORE
    seeds = range(wanted.seed, wanted.seed + wanted.study)
    effort = Effort(starts=wanted.starts)
    if out is not None:
        earlier_result.remove_study(out)
    try:
        with progress_bar() as progress:
            found = trust(
                chosen.method, chosen.par, chosen.options, seeds, effort, processes=None,
                store=store, progress=progress,
            )  # fmt: skip
    except KeyboardInterrupt:
        if store is not None and store.exists():
            output.message(f"finished experiments are in {store}: the same command goes on")
        raise
    shown = _as_object(chosen, found)
    files: list[Path] = []
    if out is not None:
        content = json.dumps(shown, indent=1) + "\n"
        files.append(write_bytes(out / earlier_result.STUDY, content.encode()))
    shown["files"] = [str(path) for path in files]
    output.result(json.dumps(shown) if as_json else _text(chosen, found))
    for path in files:
        output.message(f"written: {path}")
    return 0 if found.holds else 1


def _as_object(chosen: Chosen, found: Trust) -> dict[str, Any]:
    made: dict[str, Any] = finite(
        {
            "method": chosen.method.name,
            "parameter_set": chosen.name or None,
            "options": chosen.options.model_dump(mode="json"),
            "seeds": [one.seed for one in found.outcomes],
            "holds": found.holds,
            "recovered": {
                r.label: {k: v for k, v in asdict(r).items() if k != "label"} | {"holds": r.holds}
                for r in found.recovered
            },
            "experiments": [asdict(one) for one in found.outcomes],
        }
    )
    return made


def _text(chosen: Chosen, found: Trust) -> str:
    from bywire.report.estimate_tables import trust_table
    from bywire.report.table_text import table_text

    count = len(found.outcomes)
    parts = [f"{chosen.method.name}: {count} simulated experiments, each with its own noise"]
    if found.recovered:
        parts.append(table_text(trust_table(found)))
    parts += [f"- seed {o.seed} gave nothing: {o.error}" for o in found.failed[:5]]
    if len(found.failed) > 5:
        parts.append(f"- and {len(found.failed) - 5} more")
    kept: dict[str, int] = {}
    checks: dict[str, int] = {}
    for outcome in found.outcomes:
        for label in outcome.kept:
            kept[label] = kept.get(label, 0) + 1
        for name in outcome.failed_checks:
            checks[name] = checks.get(name, 0) + 1
    parts += [f"- {label} was not told in {n} of {count}" for label, n in kept.items()]
    parts += [f"- check {name} failed in {n} of {count}" for name, n in checks.items()]
    return "\n".join(parts)
