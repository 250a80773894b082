"""Linear models as the simulation steps them: the implicit midpoint rule in place of the exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.errors import StepError

_WHOLE = 1e-9  # of a step: what a sample time may differ from a multiple


def stepped(model: LinearModel, period: float, step: float) -> LinearModel:
    r"""Return what the midpoint rule makes of a continuous model with held inputs.

    .. math:: \begin{pmatrix} x_{k+1} \\ u \end{pmatrix} =
        \left[(I - \tfrac{h}{2} W)^{-1} (I + \tfrac{h}{2} W)\right]^{T/h}
        \begin{pmatrix} x_k \\ u \end{pmatrix}, \quad
        W = \begin{pmatrix} A & B \\ 0 & 0 \end{pmatrix}

    Where friction, limits and changes of contacts stay out, a run of a linear plant follows it to
    rounding: what then still differs from the exact model is the error of the step.

    Parameters
    ----------
    model
        Continuous model.
    period
        Sample time T [s].
    step
        Substep h [s], which divides T.

    Raises
    ------
    StepError
        When it does not.
    """
    count = round(period / step)
    if count < 1 or abs(count * step - period) > _WHOLE * step:
        raise StepError(
            f"step = {step * 1e6:g} us does not divide the sample time of {period * 1e6:g} us: "
            f"take for instance {period * 1e6 / max(count, 1):.12g} us"
        )
    n, m = model.B.shape
    W = np.zeros((n + m, n + m))
    W[:n, :n], W[:n, n:] = model.A, model.B
    half = 0.5 * step * W
    one = np.linalg.solve(np.eye(n + m) - half, np.eye(n + m) + half)
    whole = np.linalg.matrix_power(one, count)
    return replace(model, A=whole[:n, :n], B=whole[:n, n:], period=period)
