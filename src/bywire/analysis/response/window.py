"""Windows over which a periodic response is evaluated: how long, and how far they scatter."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.response.dataset import Sweep
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex
from bywire.core.units import shown
from bywire.simulation.repetition import KEPT
from bywire.simulation.run import Run

MOST_SAMPLES = 10_000_000
"""samples of a window: 160 MB, at a kilohertz the period of a frequency of 0.2 mHz twice"""
_LOWEST = 10  # periods of the lowest frequency in a window of lines: it is rounded to one of them
_CHOICES = 24  # numbers of periods tried for a window close to the wanted frequency
_CLOSE = 1e-4  # share that a frequency may be off before a longer window is worth its time


def require_measurable(run: Run, sweep: Sweep) -> None:
    """Refuse unknown signals, and frequencies and amplitudes that cannot be measured.

    Raises
    ------
    UnknownNameError
        When a signal is unknown.
    ParameterError
        When frequencies or amplitudes are not positive, or a frequency is above half the rate at
        which the slowest controller samples.
    """
    for name in sweep.inputs:
        if name not in run.model.Stimulus._fields:
            raise unknown_name("signal of the stimulus", name, run.model.Stimulus._fields)
    for name in sweep.recorded:
        if name not in run.model.Output._fields:
            raise unknown_name("signal", name, run.model.Output._fields)
    unit = signals_of(run.model.Stimulus)[sweep.inputs[0]].unit
    wanted = (("frequencies", sweep.frequencies, "Hz"), ("amplitudes", sweep.amplitudes, unit))
    for kind, values, symbol in wanted:
        if not len(values) or not all(math.isfinite(v) and v > 0 for v in values):
            given = ", ".join(shown(float(v), symbol) for v in values) or "none"
            raise ParameterError(f"{kind} = {given}: positive numbers are wanted")
    limit, highest = nyquist(run), max(sweep.frequencies)
    if highest >= limit:
        raise ParameterError(
            f"frequency {highest:g} Hz is not below the Nyquist frequency of the controller, "
            f"{limit:g} Hz: ask for lower frequencies"
        )


def nyquist(run: Run) -> float:
    """Return the slowest controller's Nyquist frequency [Hz]: any may take the input."""
    return 0.5 / max(task.period for task in run.model.tasks(run.par))


def interval(run: Run) -> float:
    """Return the sample time of the fastest task [s]: the excitation steps with it."""
    return min(task.period for task in run.model.tasks(run.par))


def common_interval(run: Run, whole: Sequence[float]) -> float:
    """Return the shortest time [s] that holds whole sample times and periods.

    Parameters
    ----------
    whole
        Frequencies [Hz] whose periods count too.
    """
    periods = [task.period for task in run.model.tasks(run.par)] + [1.0 / w for w in whole]
    return math.lcm(*(round(period / run.step) for period in periods)) * run.step


def sine_window(run: Run, f: float, sweep: Sweep) -> tuple[float, int]:
    """Return length [s] and periods of a window close to a frequency [Hz].

    What is measured is told of the frequency that the window holds. Windows that come within 1e-4
    of the wanted one are alike; up to twice as long as the shortest of them, the closest counts.
    Where none does, the closest of all.
    """
    common = common_interval(run, sweep.whole)
    least = max(sweep.least, math.ceil(sweep.shortest * f))
    choices = []
    for n in range(least, least + _CHOICES):
        length = max(round(n / f / common), 1) * common
        whole = max(round(f * length), 1)
        # Rounded: of windows that fit alike, the shortest.
        choices.append((round(abs(whole / length / f - 1.0), 9), length, whole))
    close = [length for off, length, _ in choices if off <= _CLOSE]
    longest = 2.0 * min(close, default=math.inf)
    _, length, whole = min(choice for choice in choices if choice[1] <= longest)
    _require_short(run, length, f, length * f)
    return length, whole


def _require_short(run: Run, length: float, f: float, periods: float) -> None:
    """Refuse a window of more samples than are held at once, before anything is computed."""
    samples = length / interval(run)
    if not samples <= MOST_SAMPLES:
        lowest = periods / (MOST_SAMPLES * interval(run))
        raise ParameterError(
            f"frequency {shown(f, 'Hz')}: its window would hold {samples:.3g} samples, and "
            f"{MOST_SAMPLES:.0e} are taken at most: ask for frequencies from "
            f"{shown(float(f'{lowest:.2g}'), 'Hz')} on, or a lower sample rate"
        )


def line_window(run: Run, sweep: Sweep) -> tuple[float, list[int]]:
    """Return length [s] of a window with a line near every frequency, and their numbers.

    Frequencies are multiples of 1/length; between two of them at least one line is left.

    Raises
    ------
    ParameterError
        When the frequencies do not ascend, or one is so low that its window is too long.
    """
    f = list(sweep.frequencies)
    apart = [b - a for a, b in itertools.pairwise(f)]
    if any(step <= 0 for step in apart):
        raise ParameterError(f"frequencies = {f}: write them in ascending order")
    common = common_interval(run, sweep.whole)
    wanted = max(max(sweep.least, _LOWEST) / f[0], sweep.shortest, *(2.0 / step for step in apart))
    # Half a line more: rounded to lines, neighbors keep one between them.
    _require_short(run, wanted * 1.25, f[0], wanted * 1.25 * f[0])
    length = math.ceil(wanted * 1.25 / common) * common
    return length, [math.floor(frequency * length + 0.5) for frequency in f]


def kept(figures: Complex, settled: NDArray[np.bool_]) -> np.ma.MaskedArray[Any, Any]:
    """Return the windows that count: the last two of what repeats, else all that are kept.

    Parameters
    ----------
    figures
        Complex amplitudes of the last windows, shape (cases, KEPT, lines); see
        ``simulation.repetition``.
    settled
        Which cases repeat, shape (cases,).
    """
    old = np.arange(KEPT)[None] < np.where(settled, KEPT - 2, 0)[:, None]
    return np.ma.array(figures, mask=np.isnan(figures) | old[:, :, None])


def spread_of(figures: Complex, settled: NDArray[np.bool_]) -> tuple[Complex, Array]:
    """Return complex amplitudes and their scatter.

    Parameters
    ----------
    figures, settled
        As in `kept`.

    Returns
    -------
    tuple
        Amplitudes, shape (cases, lines): those of the last window where they repeat, else the
        mean of the windows that count. Their scatter as a share of that: root mean square of the
        windows' distance from their mean. A drift counts as scatter.
    """
    seen = kept(figures, settled)
    mean = seen.mean(axis=1)
    apart = np.sqrt((np.abs(seen - mean[:, None]) ** 2).mean(axis=1))
    value = np.where(settled[:, None], figures[:, -1], np.ma.filled(mean, np.nan))
    with np.errstate(invalid="ignore", divide="ignore"):
        return value, np.asarray(np.ma.filled(apart, np.nan) / np.abs(value))
