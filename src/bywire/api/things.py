"""Everything that has a name, with a line on each: what loads all brakes."""

from __future__ import annotations

from typing import Any

from bywire.analysis.linear.plant import PLANTS
from bywire.analysis.loop import LOOPS
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.bench.kpis.registry import definitions
from bywire.bench.stimuli.registry import STIMULI
from bywire.core.brake import brakes
from bywire.core.catalog import PARAMETER_SETS
from bywire.identification.fitting.question import BENCH_METHODS
from bywire.identification.method import METHODS, Method
from bywire.synthesis.study import STUDIES


def all_things() -> dict[str, Any]:
    """Return kind of thing -> name -> summary, as plain data."""
    sets, experiments = PARAMETER_SETS.all().values(), EXPERIMENTS.all().values()
    anywhere = {e.name: f"{e.summary} (any)" for e in GENERIC_EXPERIMENTS.all().values()}
    for_benches = {
        m.name: f"{m.summary} (any, with --bench)" for m in BENCH_METHODS.all().values()
    }  # fmt: skip
    return {
        "brakes": {brake.name: brake.summary for brake in brakes().values()},
        "assemblies": sorted({cited.assembly for cited in sets}),
        "parameter_sets": {cited.name: cited.summary for cited in sets},
        "experiments": _of_assemblies(experiments),
        "generic_experiments": anywhere,
        "loops": _of_assemblies(LOOPS.all().values()),
        "plants": _of_assemblies(PLANTS.all().values()),
        "studies": _of_assemblies(STUDIES.all().values()),
        "methods": {m.name: _method(m) for m in METHODS.all().values()} | for_benches,
        "stimuli": {stimulus.name: stimulus.summary for stimulus in STIMULI.all().values()},
        "kpis": {kpi.name: kpi.definition for kpi in definitions().values()},
        "kpis_of_experiments": {e.name: dict(e.kpis) for e in experiments},
    }


def _of_assemblies(things: Any) -> dict[str, str]:
    return {thing.name: f"{thing.summary} ({thing.assembly})" for thing in things}


def _method(method: Method) -> str:
    signals = ", ".join(f"{name} [{unit or 'any'}]" for name, unit in method.signals.items())
    return f"{method.summary}; needs {signals} ({method.assembly or 'any'})"
