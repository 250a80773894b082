"""What a reduced model leaves out: its largest error over a band, channel by channel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.rates import rates
from bywire.core.errors import ParameterError
from bywire.core.typing import Array

_POINTS = 300
_DECADES = 4.0  # below the band's end at which the search begins
_NOTHING = 1e-12  # of the largest response: a channel below it has no gain to compare


@dataclass(frozen=True)
class ReductionError:
    r"""Largest differences of two models over a band, in the worst of all channels.

    Parameters
    ----------
    low, high
        The band [Hz].
    relative
        Largest :math:`|\hat G - G| / |G|`.
    gain
        Largest difference of magnitude [dB].
    phase
        Largest difference of phase [degree].
    at
        Frequency of the largest relative error [Hz].
    channel
        Output and input of the largest relative error.
    poles
        Largest distance of a pole within the band from the nearest one of the full model, as a
        share of its own size; NaN where no pole lies there.
    """

    low: float
    high: float
    relative: float
    gain: float
    phase: float
    at: float
    channel: tuple[str, str]
    poles: float


def reduction_error(full: LinearModel, reduced: LinearModel, high: float) -> ReductionError:
    """Return how far a model is off another one, from four decades below a frequency up to it.

    Parameters
    ----------
    full, reduced
        Models of the same inputs, outputs and sample time.
    high
        End of the band [Hz].

    Raises
    ------
    ParameterError
        When the signals differ, or the band does not exist.

    Notes
    -----
    Besides a logarithmic grid the frequencies of all poles are looked at, where peaks are.
    Channels without gain are left out.
    """
    f = frequencies(full, reduced, high)
    exact, other = full.response(f), reduced.response(f)
    size = np.abs(exact)
    peak = np.max(size, axis=0)
    # A channel has its own unit: what counts as nothing is told by its inputs and outputs.
    seen = peak > _NOTHING * np.sqrt(np.outer(np.max(peak, axis=1), np.max(peak, axis=0)))
    if not seen.any():
        return ReductionError(
            float(f[0]), float(f[-1]), 0.0, 0.0, 0.0, float(f[0]), ("", ""), math.nan
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(seen[None], other / exact, 1.0)
        relative = np.abs(ratio - 1.0)
        gain = np.abs(20.0 * np.log10(np.abs(ratio)))
        phase = np.abs(np.degrees(np.angle(ratio)))
    k, i, j = np.unravel_index(int(np.argmax(relative)), relative.shape)
    return ReductionError(
        float(f[0]),
        float(f[-1]),
        float(relative[k, i, j]),
        float(np.max(gain)),
        float(np.max(phase)),
        float(f[k]),
        (full.outputs[i], full.inputs[j]),
        _pole_error(full, reduced, float(f[0]), high),
    )


def frequencies(full: LinearModel, reduced: LinearModel, high: float) -> Array:
    """Return the frequencies [Hz] at which two models are compared, ascending."""
    same = ("inputs", "outputs", "period")
    if any(getattr(full, name) != getattr(reduced, name) for name in same):
        raise ParameterError(
            f"{full.name} and {reduced.name} have other inputs, outputs or sample times: "
            "only models of the same signals compare"
        )
    nyquist = 0.5 / full.period if full.period else math.inf
    if not 0.0 < high < math.inf:
        raise ParameterError(f"band = {high:g} Hz is not admissible: it must be > 0 Hz and finite")
    if high > nyquist:
        raise ParameterError(
            f"band = {high:g} Hz is not admissible: it must be <= {nyquist:g} Hz, half the "
            "sampling frequency"
        )
    low = high * 10.0**-_DECADES
    corners = np.concatenate([natural(full), natural(reduced)])
    inside = corners[(corners > low) & (corners < high)]
    return np.unique(np.concatenate([np.geomspace(low, high, _POINTS), inside]))


def _pole_error(full: LinearModel, reduced: LinearModel, low: float, high: float) -> float:
    """Return the largest relative distance of the poles in a band [Hz]."""
    known, kept = rates(full), rates(reduced)
    inside = kept[np.abs(kept) <= 2.0 * math.pi * high]
    if not inside.size or not known.size:
        return math.nan
    distance = np.abs(inside[:, None] - known).min(axis=1)
    return float(np.max(distance / np.maximum(np.abs(inside), 2.0 * math.pi * low)))


def natural(model: LinearModel) -> Array:
    """Return the frequencies of a model's poles [Hz]; 0 for dead beats and integrators."""
    poles = model.poles()
    if not model.period:
        return np.asarray(np.abs(poles) / 2.0 / math.pi)
    live = poles[np.abs(poles) > np.finfo(float).tiny]
    return np.asarray(np.abs(np.log(live)) / 2.0 / math.pi / model.period)
