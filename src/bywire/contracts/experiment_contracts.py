"""All contracts of an experiment: what it names is there, before anybody runs it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.experiment import EXPERIMENTS, Case, Experiment
from bywire.bench.stimuli.registry import create
from bywire.contracts.evidence import Contract, Demand, Demands, Evidence, NotCheckedError, Place
from bywire.core.catalog import PARAMETER_SETS, main_set
from bywire.core.errors import BywireError, ModelError, UnknownNameError, unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of

_SAMPLES = 201


@dataclass(frozen=True)
class Rehearsal:
    """An experiment with its defaults, and the recordings of brakes that never move.

    Parameters
    ----------
    experiment
        The experiment.
    figures
        Names of the figures that there are.
    """

    experiment: Experiment
    figures: Collection[str]

    @cached_property
    def par(self) -> Any:
        """Parameters of the first set of its assembly.

        Raises
        ------
        NotCheckedError
            When there is none.
        """
        try:
            return PARAMETER_SETS.find(main_set(self.experiment.assembly)).parameters()
        except BywireError as error:
            raise NotCheckedError(str(error)) from error

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """Its runs, with stimuli that stay at zero where a bench file has to give some."""
        experiment, options = self.experiment, self.experiment.defaults
        stimulus: Any = None
        if experiment.driven_unit is not None:
            unit = experiment.driven_unit(options)
            stimulus = create("step", {"start": 0.0, "end": 0.0, "t_step": 0.0}, unit)
        if experiment.beside is not None:
            stimulus = {} if stimulus is None else {"": stimulus}
        return (experiment.preview or experiment.cases)(self.par, options, stimulus)

    def recordings(self) -> Mapping[str, xr.Dataset]:
        """Return what would be recorded of brakes at rest, zero everywhere."""
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
    """Return whether the assembly is declared that it tests."""
    return _named("assembly", [rehearsal.experiment.assembly], ASSEMBLIES.all())


def has_its_figures(rehearsal: Rehearsal) -> Evidence:
    """Return whether every figure is declared that it names."""
    return _named("figure", rehearsal.experiment.figures, rehearsal.figures)


def drives_stimuli(rehearsal: Rehearsal) -> Iterator[Evidence]:
    """Yield whether its models have the stimuli that it drives, run by run."""
    for case in rehearsal.cases:
        driven = case.stimulus(np.zeros(1))
        yield _named(f"stimulus of {case.model.name}", driven, case.model.Stimulus._fields)


def judges_what_is_recorded(rehearsal: Rehearsal) -> Evidence:
    """Return whether the key figures that it gives are those that it declares.

    Raises
    ------
    NotCheckedError
        When a recording at rest is too little to tell.
    """
    experiment, options = rehearsal.experiment, rehearsal.experiment.defaults
    try:
        given = {kpi.name: kpi.unit for kpi in experiment.judge(rehearsal.recordings(), options)}
    except (KeyError, AttributeError, UnknownNameError, ModelError):
        raise  # it names something that is missing, or a key figure that has no translation to C
    except Exception as error:
        raise NotCheckedError(f"nothing is recorded that moves: {error}") from error
    declared = experiment.kpis_with(options)
    missing = [name for name in declared if name not in given]
    if missing:
        return Evidence(False, f"declared key figures that it never gives: {', '.join(missing)}")
    other = [name for name, unit in given.items() if declared.get(name) != unit]
    if other:
        texts = [f"{name} in {given[name]}" for name in other]
        return Evidence(False, f"key figures that it gives undeclared: {', '.join(texts)}")
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
"""what every experiment has to keep"""


def demands_on(experiment: Experiment, figures: Collection[str]) -> Demands:
    """Yield every contract that an experiment has to keep."""
    rehearsal, place = Rehearsal(experiment, figures), Place(*EXPERIMENTS.place(experiment.name))
    for contract, test in OF_AN_EXPERIMENT.items():
        yield Demand(contract, experiment.name, rehearsal, test, place)
