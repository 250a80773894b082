"""``bywire list``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from textwrap import wrap

from bywire.analysis.linear.plant import PLANTS
from bywire.analysis.loop import LOOPS
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.bench.kpis.registry import definitions
from bywire.bench.stimuli.registry import STIMULI
from bywire.cli.output import result
from bywire.core.catalog import PARAMETER_SETS
from bywire.identification.fitting.asked import BENCH_METHODS
from bywire.identification.method import METHODS, Method
from bywire.synthesis.study import STUDIES

_WIDTH = 100  # characters of a line
_NAME = 26  # columns of a name


def execute(name: str | None, as_json: bool) -> None:
    """Print what there is, or all about one name."""
    if name is not None:
        _print_one(name, as_json)
        return
    experiments = EXPERIMENTS.all()
    found = {
        "assemblies": sorted({e.assembly for e in PARAMETER_SETS.all().values()}),
        "parameter_sets": {e.name: e.summary for e in PARAMETER_SETS.all().values()},
        "experiments": {e.name: f"{e.summary} ({e.assembly})" for e in experiments.values()},
        "generic_experiments": {e.name: f"{e.summary} (any)"
                                for e in GENERIC_EXPERIMENTS.all().values()},
        "loops": {loop.name: f"{loop.summary} ({loop.assembly})" for loop in LOOPS.all().values()},
        "plants": {one.name: f"{one.summary} ({one.assembly})" for one in PLANTS.all().values()},
        "studies": {one.name: f"{one.summary} ({one.assembly})" for one in STUDIES.all().values()},
        "methods": {one.name: _method(one) for one in METHODS.all().values()}
        | {one.name: f"{one.summary} (any, with --bench)" for one in BENCH_METHODS.all().values()},
        "stimuli": {e.name: e.summary for e in STIMULI.all().values()},
        "kpis": {m.name: m.definition for m in definitions().values()},
        "kpis_of_experiments": {e.name: dict(e.kpis) for e in experiments.values()},
    }
    if as_json:
        result(json.dumps(found))
        return
    lines: list[str] = []
    for title, content in found.items():
        lines.append(title.replace("_", " "))
        pairs = content.items() if isinstance(content, dict) else ((name, "") for name in content)
        for name, about in pairs:
            lines += _entry(name, about)
        lines.append("")
    lines.append(
        "'bywire list NAME' shows the options, signals and units of one of them, of a parameter "
        "(motor.R_m), a group of parameters (motor), or a signal (p_mc)"
    )
    result("\n".join(lines))


def _print_one(name: str, as_json: bool) -> None:
    from bywire.cli.described import described, described_text

    found = described(name)
    if as_json:
        result(json.dumps({"name": name, "found": found}))
    else:
        result("\n\n".join(map(described_text, found)))


def _method(one: Method) -> str:
    signals = ", ".join(f"{name} [{unit or 'any'}]" for name, unit in one.signals.items())
    return f"{one.summary}; needs {signals} ({one.assembly or 'any'})"


def _entry(name: str, about: str | Iterable[str]) -> list[str]:
    """Return the lines of an entry: its summary, or names broken over several lines."""
    if isinstance(about, str):
        return [f"  {name:<{_NAME}}  {about}".rstrip()]
    return wrap(
        f"  {name:<{_NAME}}  {', '.join(about)}", _WIDTH, subsequent_indent=" " * (_NAME + 4)
    )
