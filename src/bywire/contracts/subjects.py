"""What can be checked by name: brakes, models, experiments, elements, laws, parameter sets."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Any

from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.kpis.registry import FAMILIES
from bywire.contracts import element_contracts, experiment_contracts, model_contracts
from bywire.contracts.elements import Element, elements_of, every_element
from bywire.contracts.evidence import Demand
from bywire.contracts.trial import Trial, start_of, start_of_a_rig
from bywire.core.brake import Brake, brakes
from bywire.core.catalog import PARAMETER_SETS, CitedSet
from bywire.core.errors import unknown_name
from bywire.core.model import ASSEMBLIES


def demands_on(name: str | None, figures: Collection[str]) -> Iterator[Demand]:
    """Yield every contract that something has to keep.

    Parameters
    ----------
    name
        Of a brake, a model, an experiment, an element, a control law or a parameter set;
        everything installed where there is none.
    figures
        Names of the figures that experiments may ask for.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    if name is None:
        yield from _on_elements(every_element().values())
        for brake in brakes().values():
            yield from _on_brake(brake, figures)
    elif name in brakes():
        yield from _on_elements(elements_of(brakes()[name]).values())
        yield from _on_brake(brakes()[name], figures)
    elif name in ASSEMBLIES.all():
        yield from _on_model(ASSEMBLIES.find(name))
    elif name in PARAMETER_SETS.all():
        yield from _on_set(PARAMETER_SETS.find(name))
    elif name in EXPERIMENTS.all():
        yield from experiment_contracts.demands_on(EXPERIMENTS.find(name), figures)
    else:
        yield from element_contracts.demands_on(_element(name))


def _element(name: str) -> Element:
    """Return an element by its dotted name, or by the last part of it where that is enough."""
    known = every_element()
    ends = [full for full in known if full.rpartition(".")[2] == name]
    if name in known or len(ends) == 1:
        return known[name if name in known else ends[0]]
    every = {*known, *brakes(), *ASSEMBLIES.all(), *PARAMETER_SETS.all(), *EXPERIMENTS.all()}
    every |= {full.rpartition(".")[2] for full in known}
    raise unknown_name("brake, model, experiment, element or parameter set", name, ends or every)


def _on_elements(elements: Iterable[Element]) -> Iterator[Demand]:
    for element in elements:
        yield from element_contracts.demands_on(element)


def _on_brake(brake: Brake, figures: Collection[str]) -> Iterator[Demand]:
    FAMILIES.of(brake.module)  # rejects a key figure that has no translation to C
    for entry in PARAMETER_SETS.of(brake.module).values():
        yield from _on_set(entry)
    for model in ASSEMBLIES.of(brake.module).values():
        yield from _on_model(model)
    for experiment in EXPERIMENTS.of(brake.module).values():
        yield from experiment_contracts.demands_on(experiment, figures)


def _on_set(entry: CitedSet) -> Iterator[Demand]:
    yield from model_contracts.demands_on_set(entry.name, entry.parameters())


def _on_model(model: Any) -> Iterator[Demand]:
    """Yield the contracts of a model: all with its first parameter set, of numbers with others."""
    entries = [e for e in PARAMETER_SETS.all().values() if e.assembly == model.name]
    for k, entry in enumerate(entries):
        subject = f"{model.name} ({entry.name})"
        yield from model_contracts.demands_on_model(subject, _trial(model, entry), k > 0)
    if not entries:
        yield from model_contracts.demands_on_model(model.name, _rig_trial(model), False)


def _trial(model: type[Any], entry: CitedSet) -> Trial:
    return Trial(model, lambda: start_of(model(), entry.parameters()))


def _rig_trial(model: type[Any]) -> Trial:
    """Return the trial of a model without a parameter set: an experiment of its brake starts it."""
    module = ASSEMBLIES.owner(model.name)
    sets = [entry.parameters() for entry in PARAMETER_SETS.of(module).values()]
    return Trial(model, lambda: start_of_a_rig(model(), sets, module))
