"""Loop gain of a controller that is not sampled: the loop cut open within the plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet


def analog_gain(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    cut: str,
    locked: Sequence[str] = (),
) -> LinearModel:
    r"""Return the exact gain of a loop that is cut open at a state; sampled controllers hold.

    With the state :math:`x_c` and all others :math:`x_o`, whatever reads the state is handed an
    input u in its place:

    .. math:: \dot x_o = A_{oo} x_o + A_{oc} u, \quad \dot x_c = A_{co} x_o + A_{cc} x_c, \quad
        L = -x_c / u

    Parameters
    ----------
    model, par, state, memory, locked
        As in ``closed_loop``; dry friction is removed.
    cut
        Field of State, for instance what an analog controller's sensor shows.

    Returns
    -------
    LinearModel
        Continuous; one input and one output, both ``cut``. The closed loop has 1 + L.

    Raises
    ------
    UnknownNameError
        When the field is unknown.
    ParameterError
        When nothing reads the state.
    """
    if cut not in model.State._fields:
        raise unknown_name("state", cut, model.State._fields)
    whole = linearize(model, par, state, memory, inputs=(), outputs=(cut,))
    kept = [name for name in whole.states if name not in locked]
    own = whole.reduced(kept, held=bool(locked))
    k = own.states.index(cut)
    A, B = own.A.copy(), own.A[:, k : k + 1].copy()
    B[k] = 0.0
    A[:, k] -= B[:, 0]
    if not B.any():
        raise ParameterError(f"{cut} cannot be cut: nothing in {model.name} reads it")
    return replace(
        own, name=f"{model.name}, cut at {cut}", A=A, B=B, C=-own.C, D=np.zeros((1, 1)),
        inputs=(cut,), input_units=own.output_units,
    )  # fmt: skip
