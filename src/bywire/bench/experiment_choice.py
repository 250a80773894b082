"""Which experiment a name means: that of the brake itself, or one of any brake."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.experiment import EXPERIMENTS, Experiment
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.registry import pick


def experiment_of(
    name: str, parameters: str, assembly: str = "", options: Mapping[str, Any] | None = None
) -> Experiment:
    """Return the experiment of a name for a parameter set.

    An experiment that a brake brings for this assembly goes before one of any brake, and that
    before one of another assembly.

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
        When there is no such experiment, or its options name signals that the model lacks.
    """
    cited = PARAMETER_SETS.find(parameters)
    system = assembly or cited.assembly
    likely = EXPERIMENTS.guess(name)
    if likely is not None and likely.assembly == system:
        return likely
    brake = PARAMETER_SETS.owner(parameters)
    its_own = EXPERIMENTS.of(brake).get(name)
    if its_own is not None and its_own.assembly == system:
        return its_own
    known = GENERIC_EXPERIMENTS.all()
    if name in known:
        models = ASSEMBLIES.of(brake)
        return known[name].bound(pick(models, system, "assembly")(), options or {})
    every = EXPERIMENTS.all()
    if name not in every:
        raise unknown_name("experiment", name, {*every, *known}, first=EXPERIMENTS.of(brake))
    return every[name]
