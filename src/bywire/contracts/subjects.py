"""Subjects of checks by name: brakes, models, experiments, elements, laws, parameter sets."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.experiment import EXPERIMENTS, Case, Experiment
from bywire.bench.kpis.families import FAMILIES
from bywire.bench.stimulus import create
from bywire.contracts import element_contracts, model_contracts
from bywire.contracts.elements import Element, elements_of, every_element
from bywire.contracts.evidence import Contract, Demand, Demands, Evidence, NotCheckedError, Place
from bywire.contracts.trial import Trial, start_of, start_of_a_rig
from bywire.core.brake import Brake, brakes
from bywire.core.catalog import PARAMETER_SETS, CitedSet, main_set
from bywire.core.errors import BywireError, ModelError, UnknownNameError, unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of


def demands_on(name: str | None, figures: Collection[str]) -> Iterator[Demand]:
    """Yield all contracts of a subject.

    Parameters
    ----------
    name
        Name of a brake, a model, an experiment, an element, a control law or a parameter set.
        Default: everything that is installed.
    figures
        Names of the figures that experiments may use.

    Raises
    ------
    UnknownNameError
        When the name is unknown. The message contains the nearest names.
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
        yield from demands_on_experiment(EXPERIMENTS.find(name), figures)
    else:
        yield from element_contracts.demands_on(_element(name))


def _element(name: str) -> Element:
    """Return an element by its dotted name, or by the last part of the name if it is unique.

    Hyphens are treated as underscores, because module names have no hyphens.
    """
    known, module = every_element(), name.replace("-", "_")
    ends = [full for full in known if full.rpartition(".")[2] == module]
    if module in known or len(ends) == 1:
        return known[module if module in known else ends[0]]
    every = {*known, *brakes(), *ASSEMBLIES.all(), *PARAMETER_SETS.all(), *EXPERIMENTS.all()}
    every |= {full.rpartition(".")[2] for full in known}
    raise unknown_name("brake, model, experiment, element or parameter set", name, ends or every)


def _on_elements(elements: Iterable[Element]) -> Iterator[Demand]:
    for element in elements:
        yield from element_contracts.demands_on(element)


def _on_brake(brake: Brake, figures: Collection[str]) -> Iterator[Demand]:
    FAMILIES.of(brake.module)  # rejects a key figure that cannot be translated to C
    for entry in PARAMETER_SETS.of(brake.module).values():
        yield from _on_set(entry)
    for model in ASSEMBLIES.of(brake.module).values():
        yield from _on_model(model)
    for experiment in EXPERIMENTS.of(brake.module).values():
        yield from demands_on_experiment(experiment, figures)


def _on_set(entry: CitedSet) -> Iterator[Demand]:
    yield from model_contracts.demands_on_set(entry.name, entry.parameters())


def _on_model(model: Any) -> Iterator[Demand]:
    """Yield all contracts of a model with its first set; with others, those on numbers."""
    entries = [e for e in PARAMETER_SETS.all().values() if e.assembly == model.name]
    for k, entry in enumerate(entries):
        subject = f"{model.name} ({entry.name})"
        yield from model_contracts.demands_on_model(subject, _trial(model, entry), k > 0)
    if not entries:
        yield from model_contracts.demands_on_model(model.name, _rig_trial(model), False)


def _trial(model: type[Any], entry: CitedSet) -> Trial:
    return Trial(model, lambda: start_of(model(), entry.parameters()))


def _rig_trial(model: type[Any]) -> Trial:
    """Return the trial of a model without a parameter set; an experiment of its brake starts it."""
    module = ASSEMBLIES.owner(model.name)
    sets = [entry.parameters() for entry in PARAMETER_SETS.of(module).values()]
    return Trial(model, lambda: start_of_a_rig(model(), sets, module))


# --- Experiments

_SAMPLES = 201


@dataclass(frozen=True)
class Rehearsal:
    """Experiment with its defaults, and recordings of brakes at rest.

    Parameters
    ----------
    experiment
        The experiment.
    figures
        Names of the existing figures.
    """

    experiment: Experiment
    figures: Collection[str]

    @cached_property
    def par(self) -> Any:
        """Parameters of the first set of its assembly.

        Raises
        ------
        NotCheckedError
            When there is no set.
        """
        try:
            return PARAMETER_SETS.find(main_set(self.experiment.assembly)).parameters()
        except BywireError as error:
            raise NotCheckedError(str(error)) from error

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """The experiment's runs, with zeros instead of a bench file's stimuli."""
        experiment, options = self.experiment, self.experiment.defaults
        stimulus: Any = None
        if experiment.driven_unit is not None:
            unit = experiment.driven_unit(options)
            stimulus = create("step", {"start": 0.0, "end": 0.0, "t_step": 0.0}, unit)
        if experiment.beside is not None:
            stimulus = {} if stimulus is None else {"": stimulus}
        return (experiment.preview or experiment.cases)(self.par, options, stimulus)

    def recordings(self) -> Mapping[str, xr.Dataset]:
        """Return recordings of brakes at rest, in which all values are zero."""
        experiment, options = self.experiment, self.experiment.defaults
        recordings = {} if experiment.static is None else experiment.static(self.par, options)
        for case in self.cases:
            time = np.linspace(-case.keep, case.duration, _SAMPLES)
            signals = signals_of(case.model.Output)
            if experiment.beside is not None:
                signals = signals_of(case.model.Stimulus) | signals
            recording = xr.Dataset(
                {
                    name: ("time", np.zeros(_SAMPLES), {"units": signal.unit})
                    for name, signal in signals.items()
                },
                coords={"time": ("time", time, {"units": "s"})},
                attrs={
                    "parameters": case.par.model_dump_json(),
                    "case": case.label,
                    "model": case.model.name,
                    "experiment": experiment.name,
                },
            )
            finish = experiment.finish
            recordings[case.label] = recording if finish is None else finish(recording, options)
        return recordings


def has_its_assembly(rehearsal: Rehearsal) -> Evidence:
    """Check that the experiment's assembly is declared."""
    return _named("assembly", [rehearsal.experiment.assembly], ASSEMBLIES.all())


def has_its_figures(rehearsal: Rehearsal) -> Evidence:
    """Check that each figure that the experiment lists is declared."""
    return _named("figure", rehearsal.experiment.figures, rehearsal.figures)


def drives_stimuli(rehearsal: Rehearsal) -> Iterator[Evidence]:
    """Check that the model of each run has the stimuli that the experiment drives."""
    for case in rehearsal.cases:
        driven = case.stimulus(np.zeros(1))
        yield _named(f"stimulus of {case.model.name}", driven, case.model.Stimulus._fields)


def judges_what_is_recorded(rehearsal: Rehearsal) -> Evidence:
    """Check that the computed key figures match the declared key figures.

    Raises
    ------
    NotCheckedError
        When a recording at rest is not sufficient.
    """
    experiment, options = rehearsal.experiment, rehearsal.experiment.defaults
    try:
        given = {kpi.name: kpi.unit for kpi in experiment.judge(rehearsal.recordings(), options)}
    except (KeyError, AttributeError, UnknownNameError, ModelError):
        raise  # a name is missing, or a key figure cannot be translated to C
    except Exception as error:
        raise NotCheckedError(f"the recording has no changing signal: {error}") from error
    declared = experiment.kpis_with(options)
    missing = [name for name in declared if name not in given]
    if missing:
        names = ", ".join(missing)
        return Evidence(False, f"the experiment does not compute the declared key figures {names}")
    other = [name for name, unit in given.items() if declared.get(name) != unit]
    if other:
        texts = [f"{name} in {given[name]}" for name in other]
        names = ", ".join(texts)
        return Evidence(False, f"the experiment does not declare the key figures {names}")
    return Evidence(True, f"{len(given)} key figures")


def _named(kind: str, names: Collection[str], known: Collection[str]) -> Evidence:
    unknown = [str(unknown_name(kind, name, known)) for name in names if name not in known]
    return Evidence(not unknown, "; ".join(unknown) or ", ".join(names) or "none")


OF_AN_EXPERIMENT: dict[str, Contract] = {
    "assembly": has_its_assembly,
    "figures": has_its_figures,
    "stimuli": drives_stimuli,
    "key figures": judges_what_is_recorded,
}
"""contracts of each experiment"""


def demands_on_experiment(experiment: Experiment, figures: Collection[str]) -> Demands:
    """Yield all contracts of an experiment, for each assembly that it tests."""
    place = Place(*EXPERIMENTS.place(experiment.name))
    for assembly in (experiment.assembly, *experiment.variants):
        is_main = assembly == experiment.assembly
        subject = experiment.name if is_main else f"{experiment.name} ({assembly})"
        rehearsal = Rehearsal(experiment.of(assembly), figures)
        for contract, test in OF_AN_EXPERIMENT.items():
            yield Demand(contract, subject, rehearsal, test, place)
