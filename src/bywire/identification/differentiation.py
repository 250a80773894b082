"""Derivatives of measured signals: zero-phase low-pass filter, then central differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, counted, not_valid
from bywire.core.typing import Array
from bywire.identification.measured import require_signals
from bywire.identification.output_error import even_interval

if TYPE_CHECKING:
    import xarray as xr

_ORDER = 4
_STENCIL = np.array([1.0, -9.0, 45.0, 0.0, -45.0, 9.0, -1.0]) / 60.0  # reversed, for convolve
_REACH = 3
_HOLD = np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0


@checked
def low_passed(values: Array, interval: float, cutoff: float) -> Array:
    """Low-pass signals without delay.

    Butterworth of order 4, forward and backward (gain 1/2 at the cutoff).

    Parameters
    ----------
    values
        Shape (n, ...), one row per sample.
    interval
        Sample time [s].
    cutoff
        [Hz], below half the sample rate.

    Raises
    ------
    ParameterError
        When the cutoff is out of range, or there are too few samples.
    """
    from scipy import signal

    nyquist = 0.5 / interval
    if not 0.0 < cutoff < nyquist:
        valid = f"> 0 Hz and < {nyquist:g} Hz"
        raise not_valid("cutoff", f"{cutoff:g} Hz", valid, "half the sample rate")
    sos = signal.butter(_ORDER, cutoff / nyquist, output="sos")
    pad = min(int(3.0 / (cutoff * interval)) + 1, len(values) - 1)
    if pad < _ORDER:
        raise ParameterError(
            f"a low-pass filter needs more than {counted(len(values), 'sample')}",
            name="samples",
            value=str(len(values)),
        )
    return np.asarray(signal.sosfiltfilt(sos, values, axis=0, padlen=pad))


def _derivative(values: Array, interval: float) -> Array:
    """Return sixth-order central differences, second-order ones in the three rows at each end.

    Second-order differences reduce an acceleration at a hundredth of the sample rate by 0.1 %,
    which biases the inertia.
    """
    slopes = np.gradient(values, interval, edge_order=2)
    if values.size > 2 * _REACH:
        slopes[_REACH:-_REACH] = np.convolve(values, _STENCIL, mode="valid") / interval
    return np.asarray(slopes)


def _centered(values: Array) -> Array:
    """Return the effect of a held signal on a double integrator around each sample.

    It includes half an interval of delay, and the hold's sinc up to the fourth power of the
    frequency.
    """
    padded = np.concatenate((values[:1], values[:1], values, values[-1:]))
    return np.convolve(padded, _HOLD, mode="valid")


@checked
def differentiated(
    data: xr.Dataset,
    signal: str,
    names: tuple[str, ...],
    cutoff: float,
    held: Sequence[str] = (),
) -> xr.Dataset:
    """Return low-passed data with derivatives of one signal.

    All signals go through the same filter, so that an equation between them still holds.

    Parameters
    ----------
    data
        Signals over ``time`` [s], evenly spaced.
    signal
        Signal to differentiate.
    names
        Names of its first and higher derivatives.
    cutoff
        Cutoff of the low-pass filter [Hz].
    held
        Signals that a controller sets and holds for one interval, for example a voltage. Around a
        sample, the mean of the values before and after it acts. Without this correction, the
        signals are half an interval early and slightly too large.

    Raises
    ------
    UnknownNameError
        When there is no such signal.
    ParameterError
        When time is not evenly spaced, or the cutoff is out of range.
    """
    require_signals(data, (signal, *held))
    interval = even_interval(data["time"].values)
    data = data.assign({name: ("time", _centered(data[name].values)) for name in held})
    smooth = data.map(lambda column: column.copy(data=low_passed(column.values, interval, cutoff)))
    values, unit = smooth[signal].values, smooth[signal].attrs.get("units", "1")
    for k, name in enumerate(names, 1):
        values = _derivative(values, interval)
        power = "s" if k == 1 else f"s**{k}"
        smooth[name] = ("time", values, {"units": f"{unit}/{power}", "long_name": name})
    return smooth
