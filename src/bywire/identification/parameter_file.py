"""Identified parameters as a bench file, which ``bywire run`` takes as it is."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from bywire.bench.bench import Bench
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
        Experiment that the file runs.
    parameters
        Name of the parameter set that the changes are made to.
    par
        Parameters of that set, for units.
    changes
        Dotted name -> value, SI, or choice. What the experiment itself sets is left out, and
        said.
    comment
        First line.
    """
    left_out: list[str] = []
    wanted = dict(changes)
    problem = ""
    while True:
        try:
            Bench(experiment, parameters, overrides=wanted)
            break
        except InputError as error:
            found = _WITHOUT_EFFECT.match(str(error))
            if found is None or found[1] not in wanted:
                problem = str(error).splitlines()[0]
                break
            left_out.append(f"{found[1]} = {_written(found[1], wanted.pop(found[1]), par)}")
    lines = [f"# {line}" for line in comment.splitlines()]
    if problem:
        lines.append(f"# experiment {experiment!r} wants more than this file says: {problem}")
    lines += [f'experiment = "{experiment}"', f'parameters = "{parameters}"', "", "[set]"]
    lines += [f'"{name}" = {_written(name, value, par)}' for name, value in wanted.items()]
    lines += [f"# the experiment sets this itself: {text}" for text in left_out]
    return "\n".join(lines) + "\n"


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
