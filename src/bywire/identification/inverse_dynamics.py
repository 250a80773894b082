"""Inverse dynamics: the equation of motion, with measured motions in it, solved for parameters.

No run is needed, so that it is quick and takes any start; what it needs is that all of the
equation is measured or a derivative of what is measured. While the body moves, dry friction has
the value that its direction gives it; samples near a reversal tell nothing and are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.identification.confidence import uncertainty
from bywire.identification.differentiation import low_passed
from bywire.identification.equation import Equation, EquationError
from bywire.identification.estimate import Estimate
from bywire.identification.identifiability import MisfitWarning, misfit, notes_of
from bywire.identification.leftover import Part
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown

_ROUNDS, _SETTLED = 50, 1e-12
_DECIMATED = 0.8  # of half the new sample rate: what the decimation filter lets pass


def inverse_dynamics(
    equation: Equation,
    par: ParameterSet,
    unknowns: Sequence[Unknown],
    data: xr.Dataset,
    *,
    bandwidth: float | None = None,
    instruments: xr.Dataset | None = None,
    weights: Array | None = None,
) -> Estimate:
    r"""Solve an equation of motion for parameters.

    Least squares on :math:`e = m \dot x - balance - friction`; where e is affine in the unknowns
    this is the linear regression :math:`e = W \pi - y` and needs no start. With instruments,
    the estimate solves :math:`Z^T e = 0` with Z the derivatives of e along a simulated motion,
    which no measurement noise has touched: it stays unbiased where noise gets into W.

    Parameters
    ----------
    equation
        What is solved.
    par
        Everything that is known.
    unknowns
        Parameters to estimate.
    data
        States, memories (what controllers put out) and the rate, under the model's names, over
        ``time`` [s], evenly spaced; see ``differentiated``.
    bandwidth
        Frequency up to which the equation is trusted [Hz]: residuals are low-passed and decimated
        to about twice that, so that they are independent. None for all samples as they are.
    instruments
        A simulation of the same experiment, filtered alike.
    weights
        How much each sample counts, the inverse of its variance up to a factor, shape (n,); all
        alike by default.

    Raises
    ------
    UnknownNameError
        When the equation needs a signal that is not measured.
    ParameterError
        When too few samples move, or they do not tell the unknowns.
    ModelError
        When the model has no such state.
    """
    evaluate = EquationError(equation, par, unknowns)
    interval = even_interval(data["time"].values)
    keep = _thinned(data, equation, interval, bandwidth)
    seen = evaluate.columns(data)
    other = None if instruments is None else evaluate.columns(instruments)
    root = np.ones(keep.size) if weights is None else np.sqrt(weights[keep])
    values = np.array([u.start for u in unknowns])
    scale = np.array([u.scale for u in unknowns])

    def rows(columns: Array) -> tuple[Array, Array]:
        e, W = evaluate(columns, values)
        table = np.column_stack((e, W * scale))
        if bandwidth is not None:
            table = low_passed(table, interval, bandwidth)
        return table[keep, 0] * root, table[keep, 1:] * root[:, None]

    for _ in range(_ROUNDS):
        e, W = rows(seen)
        if len(e) <= len(values):
            raise ParameterError(
                f"{len(e)} samples move faster than {equation.slowest:g}: too few for "
                f"{len(values)} unknowns; move more, or lower the slowest speed"
            )
        Z = W if other is None else rows(other)[1]
        _require_told(W, unknowns)
        if other is None:
            change = np.linalg.lstsq(W, e, rcond=None)[0]
        else:
            change = np.linalg.solve(Z.T @ W, Z.T @ e)
        values = values - change * scale
        if np.abs(change).max() < _SETTLED * max(1.0, np.abs(values / scale).max()):
            break
    e, W = rows(seen)
    Z = W if other is None else rows(other)[1]
    sure = uncertainty(W, e, instruments=None if other is None else Z)
    estimate = Estimate(
        unknowns=tuple(unknowns),
        values=values,
        covariance=sure.covariance * np.outer(scale, scale),
        singular_values=np.asarray(np.linalg.svd(W, compute_uv=False), dtype=float),
        residuals=e / np.where(root > 0.0, root, 1.0),
        freedom=sure.freedom,
        colored=sure.colored,
        parts=(
            Part(
                f"equation of {equation.state}",
                "",
                len(e),
                equation.unit,
                spread=float(np.std(W @ (values / scale) - e)),
            ),
        ),
    )
    if wrong := misfit(estimate):
        warnings.warn(wrong, MisfitWarning, stacklevel=2)
    return estimate.noted(notes_of(estimate))


def _require_told(W: Array, unknowns: Sequence[Unknown]) -> None:
    """Refuse data in which a combination of the unknowns leaves no trace."""
    size = np.linalg.norm(W, axis=0)
    silent = [u.label for u, s in zip(unknowns, size, strict=True) if s == 0.0]
    if silent:
        raise ParameterError(
            f"the data does not tell {', '.join(silent)}: nothing that it acts on moves; "
            "excite it, or take it as known"
        )
    _, s, V = np.linalg.svd(W / size, full_matrices=False)  # U would have samples squared
    if s[-1] < 1e-10 * s[0]:
        together = [u.label for u, v in zip(unknowns, V[-1], strict=True) if abs(v) > 0.1]
        raise ParameterError(
            f"the data tells only a combination of {', '.join(together)}: take one of them as "
            "known, or excite them apart"
        )


def _thinned(
    data: xr.Dataset, equation: Equation, interval: float, bandwidth: float | None
) -> NDArray[np.int64]:
    """Return the samples that count: decimated, away from reversals and from the ends."""
    count = data.sizes["time"]
    every = 1
    margin = 0
    if bandwidth is not None:
        every = max(int(_DECIMATED / (2.0 * bandwidth * interval)), 1)
        margin = min(int(1.0 / (bandwidth * interval)), count // 20)
    index = np.arange(3 * margin, count - 3 * margin, every)
    if equation.state in equation.model.frictions:
        slow = np.abs(data[equation.state].values) <= equation.slowest
        mixed = np.ones(2 * margin + 1)  # what the filter mixes
        near = np.convolve(slow, mixed, mode="same") > 0.5
        index = index[~near[index]]
    return index
