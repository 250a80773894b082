"""Everything that has a name, with a line on each: what loads all brakes."""

from __future__ import annotations

from typing import Any

from bywire.analysis.loop import LOOPS, PLANTS
from bywire.api.described import fault_summaries
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.bench.kpis.families import definitions
from bywire.bench.stimulus import STIMULI
from bywire.campaigns.residual import CAMPAIGNS, RESIDUALS
from bywire.contracts.elements import every_element
from bywire.core.brake import brakes, loaded_files
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.quantities import display_unit
from bywire.core.registry import Kind
from bywire.identification.method import METHODS, Method
from bywire.identification.question import BENCH_METHODS
from bywire.life.declaration import LIVES
from bywire.synthesis.study import STUDIES


def all_things() -> dict[str, Any]:
    """Return kind of thing -> name -> summary, as plain data; what was loaded by path first."""
    sets, experiments = _in_order(PARAMETER_SETS), _in_order(EXPERIMENTS)
    anywhere = {e.name: f"{e.summary} (any)" for e in GENERIC_EXPERIMENTS.all().values()}
    for_benches = {m.name: f"{m.summary} (any, with --bench)" for m in BENCH_METHODS.all().values()}
    files = loaded_files()
    known = sorted(brakes().values(), key=lambda brake: brake.file not in files)
    return {
        "brakes": {brake.name: brake.summary for brake in known},
        "assemblies": sorted(_tested({cited.assembly for cited in sets})),
        "parameter_sets": {cited.name: cited.summary for cited in sets},
        "experiments": _of_assemblies(experiments),
        "generic_experiments": anywhere,
        "elements": {name: each.summary for name, each in every_element().items()},
        "loops": _of_assemblies(_in_order(LOOPS)),
        "plants": _of_assemblies(_in_order(PLANTS)),
        "studies": _of_assemblies(_in_order(STUDIES)),
        "lives": {life.name: life.summary for life in _in_order(LIVES)},
        "methods": {m.name: _method(m) for m in _in_order(METHODS)} | for_benches,
        "stimuli": {stimulus.name: stimulus.summary for stimulus in STIMULI.all().values()},
        "faults": fault_summaries(),
        "campaigns": {each.name: each.summary for each in CAMPAIGNS.all().values()},
        "residuals": {
            each.name: f"{each.summary} [{display_unit(each.unit)}] ({', '.join(each.assemblies)})"
            for each in RESIDUALS.all().values()
        },
        "kpis": {kpi.name: kpi.definition for kpi in definitions().values()},
        "kpis_of_experiments": {e.name: dict(e.kpis) for e in experiments},
    }


def _tested(named: set[str]) -> set[str]:
    """Return the assemblies that there are numbers for, and all of a brake without any such."""
    tested = named & ASSEMBLIES.all().keys()
    for brake in brakes().values():
        its = ASSEMBLIES.of(brake.module).keys()
        tested |= its if its.isdisjoint(named) else set()
    return tested


def doubts() -> list[str]:
    """Return what is said of parameter sets whose assembly is nowhere."""
    known = ASSEMBLIES.all()
    texts = []
    for cited in PARAMETER_SETS.all().values():
        if cited.assembly not in known:
            file, line = PARAMETER_SETS.place(cited.name)
            nearest = unknown_name("assembly", cited.assembly, known)
            texts.append(
                f"{file}, line {line}: parameter set {cited.name!r} is for an assembly that no "
                f"brake declares: {nearest}"
            )
    return texts


def _in_order(kind: Kind[Any]) -> list[Any]:
    """Return all things of a kind, those of brakes that were loaded by path first."""
    files = loaded_files()
    loaded = [each for each in brakes().values() if each.file in files]
    first = {name: thing for brake in loaded for name, thing in kind.of(brake.module).items()}
    return [*({**first, **kind.all()}).values()]


def _of_assemblies(things: Any) -> dict[str, str]:
    return {thing.name: f"{thing.summary} ({thing.assembly})" for thing in things}


def _method(method: Method) -> str:
    signals = ", ".join(f"{name} [{unit or 'any'}]" for name, unit in method.signals.items())
    return f"{method.summary}; needs {signals} ({method.assembly or 'any'})"
