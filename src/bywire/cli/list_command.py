"""``bywire list``."""

from __future__ import annotations

import json

from bywire.bench.kpis.registry import definitions
from bywire.bench.registry import all_experiments
from bywire.bench.stimuli.registry import entries as stimuli
from bywire.catalog.registry import entries
from bywire.cli.output import result


def execute(as_text: bool) -> None:
    """Print what there is."""
    found = {
        "assemblies": sorted({e.assembly for e in entries().values()}),
        "parameter_sets": {e.name: e.summary for e in entries().values()},
        "experiments": {e.name: e.summary for e in all_experiments().values()},
        "stimuli": {e.kind: e.summary for e in stimuli().values()},
        "kpis": {m.name: m.definition for m in definitions().values()},
    }
    if as_text:
        result(json.dumps(found))
        return
    lines: list[str] = []
    for title, content in found.items():
        lines.append(title.replace("_", " "))
        pairs = content.items() if isinstance(content, dict) else ((name, "") for name in content)
        lines += [f"  {name:<24}{summary}".rstrip() for name, summary in pairs]
        lines.append("")
    result("\n".join(lines))
