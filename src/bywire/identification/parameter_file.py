"""Identified parameters as a bench file, which ``bywire run`` takes as it is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.experiment import EXPERIMENTS
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import InputError
from bywire.core.parameters import ParameterSet, leaf_fields

_WITHOUT_EFFECT = re.compile(r"([\w.]+) = .* would have no effect")


def parameter_file(
    experiment: str,
    parameters: str,
    par: ParameterSet,
    changes: Mapping[str, Any],
    comment: str = "",
) -> str:
    """Return the text of a bench file.

    Parameters
    ----------
    experiment
        Experiment that the file runs; another one of the same assembly where it wants more than
        parameters.
    parameters
        Name of the parameter set that the changes are made to.
    par
        Parameters of that set, for units.
    changes
        Dotted name -> value, SI, or choice. What has no effect in the experiment is left
        out, and a comment says so.
    comment
        First line.
    """
    wanted, left_out, problem = _accepted(experiment, parameters, changes)
    notes = comment.splitlines()
    if problem:
        for other in _alternatives(parameters):
            accepted, left, trouble = _accepted(other, parameters, changes)
            if not trouble:
                notes.append(f"experiment {experiment!r} wants more than this file says: {problem}")
                experiment, wanted, left_out = other, accepted, left
                break
    lines = [f"# {line}" for line in notes]
    lines += [f'experiment = "{experiment}"', f'parameters = "{parameters}"', "", "[set]"]
    lines += [f'"{name}" = {_written(name, value, par)}' for name, value in wanted.items()]
    lines += [
        f"# without effect in this experiment: {name} = {_written(name, changes[name], par)}"
        for name in left_out
    ]
    return "\n".join(lines) + "\n"


def _accepted(
    experiment: str, parameters: str, changes: Mapping[str, Any]
) -> tuple[dict[str, Any], list[str], str]:
    """Return the changes that take effect, the others' names, and why none of it runs."""
    wanted: dict[str, Any] = dict(changes)
    left_out: list[str] = []
    while True:
        try:
            Bench(experiment, parameters, overrides=wanted)
        except InputError as error:
            refused = _WITHOUT_EFFECT.match(str(error))
            if refused is None or refused[1] not in wanted:
                return wanted, left_out, str(error).splitlines()[0]
            left_out.append(refused[1])
            wanted.pop(refused[1])
            continue
        return wanted, left_out, ""


def _alternatives(parameters: str) -> list[str]:
    """Return the experiments of a parameter set's assembly that bring all they need."""
    assembly = PARAMETER_SETS.find(parameters).assembly
    return [
        experiment.name
        for experiment in EXPERIMENTS.all().values()
        if experiment.assembly == assembly and experiment.driven_unit is None
    ]


def _written(name: str, value: Any, par: ParameterSet) -> str:
    leaf = leaf_fields(type(par)).get(name)
    if isinstance(value, bool):
        return str(value).lower()
    if leaf is None or isinstance(value, str):
        return f'"{value}"'
    unit = leaf.unit.symbol
    texts = [f'"{v:.9g} {unit}"' if unit != "1" else f"{v:.9g}" for v in _nodes(value)]
    return texts[0] if not isinstance(value, tuple) else f"[{', '.join(texts)}]"


def _nodes(value: Any) -> tuple[float, ...]:
    if isinstance(value, tuple):
        return tuple(map(float, value))
    return (float(value),)
