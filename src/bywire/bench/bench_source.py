"""What is named where a bench is wanted: a file, or an experiment; and which one was meant."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from bywire.bench.experiment import EXPERIMENTS, Experiment
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS, GenericExperiment
from bywire.core.callers import option
from bywire.core.catalog import PARAMETER_SETS, main_set, sets_of_loaded
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import ASSEMBLIES
from bywire.core.registry import pick
from bywire.data.toml_file import BENCH, first_there, near_files


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


# --- Files and experiments

_NAME = re.compile(r"[a-z][a-z0-9-]*")
_FOLDER = "benches"  # where bench files usually are
_NEAR, _NEAR_EXPERIMENT = 0.5, 0.7  # resemblance of what was meant


def names_experiment(source: str | Path) -> bool:
    """Return whether a text is the bare name of an experiment, of a brake or of any."""
    name = str(source)
    if not _NAME.fullmatch(name):
        return False
    return EXPERIMENTS.get(name) is not None or name in _any_brake()


def content_of_experiment(file: Path, changes: Mapping[str, str]) -> dict[str, str]:
    """Return the shortest bench file of an experiment; nothing where there is a file instead.

    Raises
    ------
    ParameterError
        For an experiment of any brake, where ``changes`` do not say for which.
    """
    name = str(file)
    if file.is_file() or not names_experiment(name):
        return {}
    chosen = {} if "parameters" in changes else {"parameters": usual_set(name)}
    return {"experiment": name, **chosen}


def usual_set(name: str) -> str:
    """Return the parameter set with which an experiment runs unless another one is named.

    That is the main set of its brake. An experiment of any brake takes the only set of the brakes
    that were loaded by path.

    Raises
    ------
    UnknownNameError
        When there is no experiment of that name.
    ParameterError
        For an experiment of any brake where there are several sets to choose from.
    """
    definition, sets = EXPERIMENTS.get(name), sets_of_loaded()
    if len(sets) == 1 and name in _any_brake():
        return sets[0]
    if definition is not None:
        return main_set(definition.assembly, beside=type(definition.defaults))
    if name not in _any_brake():
        raise EXPERIMENTS.unknown(name, GENERIC_EXPERIMENTS)
    known = ", ".join(sets or PARAMETER_SETS.all())
    former = "".join(
        f"; that of the {assembly} is called {now!r} now"
        for now, assembly in former_names(name).items()
    )
    raise ParameterError(
        f"experiment {name!r} is for any brake: say for which, with "
        f"{option('overrides', {'parameters': 'NAME'})} ({known}){former}"
    )


def meant_by(file: Path) -> str:
    """Return what to do about a bench file that is not there.

    The nearest is named, of the bench files beside it and of experiments; a file of its very name
    in a folder of benches goes before.
    """
    folders = (file.parent / _FOLDER, file.parent / ".." / _FOLDER)
    there = first_there(folder / file.name for folder in folders)
    if there is not None:
        return f"did you mean {there}?"
    near = max(_near(file), default=None)
    if near is not None:
        return f"did you mean {near[1]}?"
    return "check the path, or name an experiment of 'bywire list'"


def _near(file: Path) -> Iterator[tuple[float, str]]:
    """Yield bench files and experiments that a file resembles, each with how much it does."""
    kinds = ("", BENCH)
    files = near_files(file, kinds, [file.parent], _NEAR, with_ending=True)
    yield from ((likeness, str(path)) for likeness, path in files)
    if _NAME.fullmatch(file.name):
        for name in {**EXPERIMENTS.all(), **_any_brake()}:
            likeness = SequenceMatcher(None, name, file.name).ratio()
            if likeness >= _NEAR_EXPERIMENT:
                yield likeness, name


def _any_brake() -> Mapping[str, GenericExperiment]:
    return GENERIC_EXPERIMENTS.all()
