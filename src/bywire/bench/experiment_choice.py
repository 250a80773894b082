"""Which experiment a name means: one of a brake, or one of any brake; never both."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.experiment import EXPERIMENTS, Experiment
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS, GenericExperiment
from bywire.core.callers import option
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.registry import pick


def experiment_of(
    name: str, parameters: str, assembly: str = "", options: Mapping[str, Any] | None = None
) -> Experiment:
    """Return the experiment of a name for a parameter set.

    Parameters
    ----------
    name
        Name of the experiment.
    parameters
        Name of the parameter set.
    assembly
        Model of the set's brake; that of the set where empty.
    options
        Options as the user gave them: they name signals.

    Raises
    ------
    InputError
        When there is no such experiment, when its options name signals that the model lacks, and
        when an earlier name of a brake's own experiment leaves open which one is meant.
    """
    cited = PARAMETER_SETS.find(parameters)
    system = assembly or cited.assembly
    likely = EXPERIMENTS.guess(name)
    if likely is not None and likely.assembly == system:
        return likely
    brake = PARAMETER_SETS.owner(parameters)
    its_own = EXPERIMENTS.own(brake, name)
    if its_own is not None and its_own.assembly == system:
        return its_own
    known = GENERIC_EXPERIMENTS.all()
    if name in known:
        former = _former(name, brake, system, options or {}, known[name])
        if former is not None:
            return former
        models = ASSEMBLIES.of(brake)
        return known[name].bound(pick(models, system, "assembly")(), options or {})
    every = EXPERIMENTS.all()
    if name not in every:
        raise unknown_name("experiment", name, {*every, *known}, first=EXPERIMENTS.of(brake))
    return every[name]


def former_names(name: str) -> dict[str, str]:
    """Return the experiments that once had a name, each with its assembly."""
    every = EXPERIMENTS.all().values()
    return {each.name: each.assembly for each in every if each.formerly == name}


def _former(
    name: str, brake: str, system: str, options: Mapping[str, Any], generic: GenericExperiment
) -> Experiment | None:
    """Return a brake's own experiment that once had this name, if the options show it is meant.

    Raises
    ------
    ParameterError
        When they show neither.
    """
    each = (e for e in EXPERIMENTS.of(brake).values() if e.formerly == name)
    former = next((e for e in each if e.assembly == system), None)
    if former is None:
        return None
    given = set(options)
    own, others = set(former.options.model_fields), set(generic.options.model_fields)
    if given & (others - own):
        return None
    if given & (own - others):
        return former
    example = next(iter(generic.signals))
    raise ParameterError(
        f"experiment {name!r} is for any brake, and that of the {system} is called "
        f"{former.name!r} now: write {former.name}, or say which signal {name} is about, for "
        f"instance {option('overrides', {f'options.{example}': 'NAME'})}"
    )
