"""Linear models with some of their inputs and outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.errors import unknown_name


def with_channels(
    model: LinearModel, *, inputs: Sequence[str] = (), outputs: Sequence[str] = ()
) -> LinearModel:
    """Return a model with some of its inputs and outputs, in the order given.

    Parameters
    ----------
    model
        Any.
    inputs, outputs
        Names; all where none is given.

    Raises
    ------
    UnknownNameError
        When a name is unknown.
    """
    columns = _places("input", inputs, model.inputs)
    rows = _places("output", outputs, model.outputs)
    return replace(
        model,
        B=model.B[:, columns], C=model.C[rows], D=model.D[rows][:, columns],
        inputs=tuple(model.inputs[k] for k in columns),
        outputs=tuple(model.outputs[k] for k in rows),
        input_units=tuple(model.input_units[k] for k in columns),
        output_units=tuple(model.output_units[k] for k in rows),
    )  # fmt: skip


def _places(kind: str, names: Sequence[str], known: tuple[str, ...]) -> list[int]:
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
    return [known.index(name) for name in names or known]
