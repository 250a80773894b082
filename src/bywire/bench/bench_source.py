"""What is named where a bench is wanted: a file, or an experiment; and which one was meant."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path

from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.experiment_choice import former_names
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS, GenericExperiment
from bywire.core.catalog import PARAMETER_SETS, main_set, sets_of_loaded
from bywire.core.errors import ParameterError
from bywire.data.file_kinds import BENCH, first_there, near_files

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
        f"experiment {name!r} is for any brake: say for which, with --set parameters=NAME "
        f"({known}){former}"
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
