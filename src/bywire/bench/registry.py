"""Find experiments and assemblies by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from bywire.bench import experiments
from bywire.bench.experiment import Experiment
from bywire.core.discovery import declared, pick


@cache
def all_experiments() -> Mapping[str, Experiment]:
    """Return every experiment: the ``EXPERIMENT`` of each module in ``experiments``."""
    return declared(experiments, "EXPERIMENT", Experiment)


def find_experiment(name: str) -> Experiment:
    """Return one experiment.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    module = name.replace("-", "_")
    if module in {found.name for found in pkgutil.iter_modules(experiments.__path__)}:
        # Only this one: loading them all would cost every start of the command line.
        found = importlib.import_module(f"{experiments.__name__}.{module}").EXPERIMENT
        if found.name == name:
            return found  # type: ignore[no-any-return]
    return pick(all_experiments(), name, "experiment")
