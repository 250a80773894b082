"""A design as a bench file."""

from __future__ import annotations

from collections.abc import Mapping

from bywire.core.parameters import ParameterSet, leaf_fields


def bench_text(
    title: str,
    experiment: str,
    parameters: str,
    changes: Mapping[str, str],
    par: ParameterSet,
    gains: Mapping[str, float],
) -> str:
    """Return the text of a bench file with the gains in its section ``[set]``.

    Parameters
    ----------
    title
        Comment at the top.
    experiment
        What it runs; empty for a loop without experiment of its own: the section alone.
    parameters, changes
        Name of the parameter set, and what the user changed in it, as texts.
    par
        Any parameters of that class, for the units.
    gains
        By dotted name [SI].
    """
    leaves = leaf_fields(type(par))
    lines = [f"# {title}"]
    if experiment:
        lines += [f'experiment = "{experiment}"', f'parameters = "{parameters}"']
    lines += ["", "[set]"]
    lines += [f"{name} = {_quoted(text)}" for name, text in changes.items() if name not in gains]
    for name, value in gains.items():
        unit = leaves[name].unit.symbol
        lines.append(f"{name} = {_quoted(f'{value:.9g}' + ('' if unit == '1' else f' {unit}'))}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
