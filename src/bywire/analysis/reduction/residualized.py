"""Linear models with states of one's choice, the others quasi-static."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.errors import ParameterError, unknown_name

_NO_REST = 1e14  # condition of the equation for the rest beyond which there is none


def residualized(
    model: LinearModel, keep: Sequence[str], *, corrected: bool = False
) -> LinearModel:
    r"""Return a model with some of its states, the others always at their rest (quasi-static).

    .. math:: A_{11} - A_{12} A_{22}^{-1} A_{21}, \quad \text{and so on for } B, C, D

    Exact at rest; good as long as what is left out is faster than what is looked at. Corrected,

    .. math:: x_2 = -A_{22}^{-1} (A_{21} x_1 + B_2 u) - A_{22}^{-2} A_{21} \dot x_1

    what is left out follows the kept states with its first lag; the poles are then one order
    better in the ratio of both speeds. Its lag behind the inputs stays left out.

    Parameters
    ----------
    model
        Continuous, or sampled (there :math:`I - A_{22}` takes the place of :math:`-A_{22}`).
    keep
        Names of the states to keep.
    corrected
        Whether the first lag behind the kept states counts; continuous models only.

    Raises
    ------
    UnknownNameError
        When a state is unknown.
    ParameterError
        When the others have no rest of their own, as an integrator has none.

    References
    ----------
    P. Kokotovic, H. K. Khalil, J. O'Reilly, "Singular Perturbation Methods in Control" (1986):
    slow manifold, to the zeroth and the first order.
    """
    for name in keep:
        if name not in model.states:
            raise unknown_name("state", name, model.states)
    first = [model.states.index(name) for name in keep]
    second = [k for k in range(len(model.states)) if k not in first]
    inner = np.eye(len(second)) * (1.0 if model.period else 0.0) - model.A[np.ix_(second, second)]
    size = np.abs(inner).max(axis=1, initial=0.0)
    if second and (np.any(size == 0.0) or np.linalg.cond(inner / size[:, None]) > _NO_REST):
        names = ", ".join(model.states[k] for k in second)
        raise ParameterError(
            f"{model.name}: the states left out ({names}) have no rest of their own: one of them "
            "integrates; keep it"
        )
    if corrected and model.period:
        raise ParameterError(f"{model.name}: only continuous models are corrected, this is sampled")
    A21, A12 = model.A[np.ix_(second, first)], model.A[np.ix_(first, second)]
    C2 = model.C[:, second]
    drift = model.rate[second, None]
    rest = np.linalg.solve(inner, np.hstack([A21, model.B[second], drift]))
    by_x, by_u, by_1 = np.split(rest, [len(first), len(first) + model.B.shape[1]], axis=1)
    A, B = model.A[np.ix_(first, first)] + A12 @ by_x, model.B[first] + A12 @ by_u
    rate = model.rate[first] + (A12 @ by_1)[:, 0]
    C, D = model.C[:, first] + C2 @ by_x, model.D + C2 @ by_u
    if corrected:
        lag = np.linalg.solve(inner, by_x)
        body = np.eye(len(first)) + A12 @ lag
        A, B, rate = (np.linalg.solve(body, M) for M in (A, B, rate))
        C, D = C - C2 @ lag @ A, D - C2 @ lag @ B
    return replace(
        model,
        A=A,
        B=B,
        C=C,
        D=D,
        rate=rate,
        states=tuple(keep),
        state_units=tuple(model.state_units[k] for k in first),
    )
