"""Sweeps of sines: their definition, cases and windows, harmonics, and the resulting dataset."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.loop import Saturation
from bywire.core.errors import ParameterError, not_valid, unknown_name
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex
from bywire.core.units import shown
from bywire.simulation.engine import structure_of
from bywire.simulation.ensemble import Variations, case_matrix
from bywire.simulation.repetition import KEPT
from bywire.simulation.run import Run


def amplitudes(t: Array, y: Array, f: float, count: int) -> Complex:
    """Return the complex amplitudes of the first harmonics, in sine phase.

    Parameters
    ----------
    t, y
        Evenly spaced times [s] and samples over whole periods, shape (n,) each.
    f
        Base frequency [Hz].
    count
        Number of harmonics.
    """
    order = np.arange(1, count + 1)[:, None]
    return np.asarray(2j * np.mean(y * np.exp(-2j * math.pi * f * order * t), axis=1))


def total_distortion(t: Array, y: Array, f: float, count: int = 9) -> float:
    r"""Return the total harmonic distortion as a fraction.

    .. math:: \mathrm{THD} = \sqrt{\sum_{k=2}^{n} |a_k|^2} \, / \, |a_1|

    Parameters
    ----------
    t, y, f
        As in `amplitudes`.
    count
        Highest harmonic n, below half the sampling rate.
    """
    size = np.abs(amplitudes(t, y, f, count))
    return float(np.sqrt(np.sum(size[1:] ** 2)) / size[0])


# --- Sweeps of sines


@dataclass(frozen=True)
class Sweep:
    """Excitation of a loop, and criteria for its response.

    Parameters
    ----------
    inputs
        Signals of the Stimulus that are excited together; the first determines the unit.
    output
        Responding signal of the Output.
    frequencies
        Requested frequencies [Hz], ascending; each is rounded so that a window contains whole
        periods.
    amplitudes
        Amplitudes of the sine, in the input's SI unit, > 0.
    variations
        Dotted name of a parameter -> one value per variant; empty for the run's own parameters.
    flags
        Outputs with values 0 or 1 for which the fraction of time is reported, such as ``"stuck"``.
    saturations
        Limits without such an output of the model, reported likewise.
    least
        Minimum number of periods in a window.
    shortest
        Minimum length of a window [s].
    whole
        Other frequencies [Hz] of which a window contains whole periods, such as that of a dither.
    tolerance
        A response is settled if the complex amplitude of a window differs from that of the previous
        one by less than this fraction. An encoder's resolution alone may scatter it by 0.3 %.
    most
        Maximum number of windows of a response.
    """

    inputs: Sequence[str]
    output: str
    frequencies: Sequence[float]
    amplitudes: Sequence[float]
    variations: Variations | None = None
    flags: Sequence[str] = ("stuck",)
    saturations: Sequence[Saturation] = ()
    least: int = 2
    shortest: float = 0.05
    whole: Sequence[float] = ()
    tolerance: float = 1e-3
    most: int = 60

    @property
    def recorded(self) -> tuple[str, ...]:
        """Outputs that a run must record: the response, then flags, then limited signals."""
        limited = [name for limit in self.saturations for name in limit.signals]
        return (self.output, *self.flags, *limited)

    def shares(self, values: Array, matrix: Array, names: Sequence[str]) -> dict[str, Array]:
        """Return the fraction of time of every flag and limit, shape (cases,) each.

        Parameters
        ----------
        values
            Recorded signals, shape (cases, rows, signals).
        matrix, names
            Parameter vectors, shape (parameters, cases), and the names of their rows.
        """
        k = 1 + len(self.flags)
        means = values[:, :, 1:k].mean(axis=1)
        shares = {f"share_{name}": means[:, j] for j, name in enumerate(self.flags)}
        for limit in self.saturations:
            signals = values[:, :, k : k + len(limit.signals)]
            shares[f"share_{limit.name}"] = limit.share(signals, matrix, names)
            k += len(limit.signals)
        return shares


def as_dataset(
    run: Run, sweep: Sweep, frequencies: list[float], done: list[dict[str, Array]]
) -> xr.Dataset:
    """Return the figures of all frequencies, each of shape (variants, amplitudes), as a dataset."""
    stimuli, outputs = signals_of(run.model.Stimulus), signals_of(run.model.Output)
    ratio = f"({outputs[sweep.output].unit})/({stimuli[sweep.inputs[0]].unit})"
    units = {"phase": "degree", "gain": ratio}
    stacked = {name: np.stack([figures[name] for figures in done], axis=2) for name in done[0]}
    stacked["phase"] = _unwrapped(stacked["phase"])
    variables: dict[str, Any] = {
        name: (("variant", "amplitude", "frequency"), value, {"units": units.get(name, "1")})
        for name, value in stacked.items()
    }
    coordinates: Mapping[str, Any] = {
        "frequency": ("frequency", frequencies, {"units": "Hz"}),
        "amplitude": (
            "amplitude",
            np.asarray(sweep.amplitudes, dtype=float),
            {"units": stimuli[sweep.inputs[0]].unit},
        ),
        **{
            name: ("variant", np.asarray(values, dtype=float))
            for name, values in (sweep.variations or {}).items()
        },
    }
    attributes = {
        "model": run.model.name,
        "inputs": " ".join(sweep.inputs),
        "output": sweep.output,
        "step": run.step,
    }
    return xr.Dataset(variables, coords=dict(coordinates), attrs=attributes)


def _unwrapped(phase: Array) -> Array:
    """Return phases without jumps along frequency, ignoring gaps due to stiction."""
    unwrapped = phase.copy()
    for index in np.ndindex(phase.shape[:2]):
        known = np.isfinite(phase[index])
        unwrapped[index][known] = np.unwrap(phase[index][known], period=360.0)
    return unwrapped


def complex_values(response: xr.Dataset) -> Complex:
    """Return gain and phase of a response as complex numbers; NaN if the output sticks."""
    return np.asarray(response["gain"].values * np.exp(1j * np.radians(response["phase"].values)))


def response_data(response: xr.Dataset, variant: int = 0, amplitude: int = 0) -> Any:
    """Return one variant and amplitude as ``control.FrequencyResponseData``.

    The result does not contain frequencies at which the output stuck.
    """
    import control

    part = response.isel(variant=variant, amplitude=amplitude)
    values = complex_values(part)
    known = np.isfinite(values)
    return control.frd(values[known], 2.0 * math.pi * part["frequency"].values[known])


# --- Cases: every variant with every amplitude, each at its own operating point


@dataclass(frozen=True, eq=False)
class Cases:
    """Cases that run in parallel, ordered by variant, then by amplitude.

    Parameters
    ----------
    matrix
        Parameter vectors, shape (parameters, cases).
    starts
        State and memory at the start of each case.
    rest
        Stimulus to which the excitation is added, shape (cases, nu).
    sizes
        Amplitudes, SI, shape (cases,).
    shape
        Numbers of variants and amplitudes.
    """

    matrix: Array
    starts: list[tuple[Any, Any]]
    rest: Array
    sizes: Array
    shape: tuple[int, int]


def cases_of(run: Run, sweep: Sweep, points: Sequence[Run] | None) -> Cases:
    """Return the cases of a sweep.

    Parameters
    ----------
    run
        The loop at its operating point.
    sweep
        Amplitudes, and variations of the run's parameters, which keep its operating point.
    points
        Variants with their own operating points, instead of variations.

    Raises
    ------
    ParameterError
        When a variant has other sample times or choices than the run, or both kinds are specified.
    """
    sizes = np.asarray(sweep.amplitudes, dtype=float)
    if points is None:
        variations = dict(sweep.variations or {})
        matrix = case_matrix(run, variations) if variations else _column(run)[:, None]
        runs = [run] * matrix.shape[1]
    else:
        _require_alike(run, sweep, points)
        matrix, runs = np.stack([_column(variant) for variant in points], axis=1), list(points)
    n = sizes.size
    return Cases(
        matrix=np.repeat(matrix, n, axis=1),
        starts=[(variant.state, variant.memory) for variant in runs for _ in range(n)],
        rest=np.repeat(np.concatenate([run.stimulus(np.zeros(1)) for run in runs]), n, axis=0),
        sizes=np.tile(sizes, len(runs)),
        shape=(len(runs), n),
    )


def _column(run: Run) -> Array:
    return np.array(list(run.par.leaves().values()))


def _require_alike(run: Run, sweep: Sweep, points: Sequence[Run]) -> None:
    if sweep.variations:
        raise ParameterError(
            "variants contains both variations and points. Specify only one of them",
            name="variants",
        )
    if not points:
        raise ParameterError("variants is empty. Specify at least one", name="variants")
    structure, tasks = structure_of(run.model, run.par), run.model.tasks(run.par)
    for k, variant in enumerate(points):
        if structure_of(variant.model, variant.par) != structure:
            raise ParameterError(
                f"variant {k} has a different model or a different choice. All variants need the "
                "same model and choices",
                name="variants",
                value=str(k),
            )
        if [t.period for t in variant.model.tasks(variant.par)] != [t.period for t in tasks]:
            raise ParameterError(
                f"variant {k} has different sample times, which cannot vary in a sweep",
                name="variants",
                value=str(k),
            )


# --- Windows over which a periodic response is evaluated: their length and scatter

MOST_SAMPLES = 10_000_000
"""maximum samples of a window: 160 MB, or at 1 kHz two periods of 0.2 mHz"""
_LOWEST = 10  # periods of the lowest frequency in a window of lines, to which it is rounded
_CHOICES = 24  # numbers of periods tried for a window close to the requested frequency
_CLOSE = 1e-4  # relative deviation of a frequency above which a longer window is worth its time


def require_measurable(run: Run, sweep: Sweep) -> None:
    """Reject unknown signals, and frequencies and amplitudes that cannot be measured.

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
            raise not_valid(kind, given, "positive numbers")
    limit, highest = nyquist(run), max(sweep.frequencies)
    if highest >= limit:
        raise ParameterError(
            f"frequency = {highest:g} Hz is not valid: it must be < {limit:g} Hz, the controller's "
            "Nyquist frequency",
            name="frequency",
            value=f"{highest:g} Hz",
            valid=f"< {limit:g} Hz",
        )


def nyquist(run: Run) -> float:
    """Return the slowest controller's Nyquist frequency [Hz], since any may read the input."""
    return 0.5 / max(task.period for task in run.model.tasks(run.par))


def interval(run: Run) -> float:
    """Return the sample time of the fastest task [s], at which the excitation steps."""
    return min(task.period for task in run.model.tasks(run.par))


def common_interval(run: Run, whole: Sequence[float]) -> float:
    """Return the shortest time [s] that contains whole sample times and periods.

    Parameters
    ----------
    whole
        Frequencies [Hz] whose periods also count.
    """
    periods = [task.period for task in run.model.tasks(run.par)] + [1.0 / w for w in whole]
    return math.lcm(*(round(period / run.step) for period in periods)) * run.step


def sine_window(run: Run, f: float, sweep: Sweep) -> tuple[float, int]:
    """Return length [s] and periods of a window close to a frequency [Hz].

    The response is reported at the frequency of its window. Windows within 1e-4 of the requested
    frequency are equivalent: of those up to twice as long as the shortest, the function chooses
    the closest one. Without such a window, it chooses the closest of all.
    """
    common = common_interval(run, sweep.whole)
    least = max(sweep.least, math.ceil(sweep.shortest * f))
    choices = []
    for n in range(least, least + _CHOICES):
        length = max(round(n / f / common), 1) * common
        whole = max(round(f * length), 1)
        # Rounded, so that of equally close windows the shortest counts.
        choices.append((round(abs(whole / length / f - 1.0), 9), length, whole))
    close = [length for off, length, _ in choices if off <= _CLOSE]
    longest = 2.0 * min(close, default=math.inf)
    _, length, whole = min(choice for choice in choices if choice[1] <= longest)
    _require_short(run, length, f, length * f)
    return length, whole


def _require_short(run: Run, length: float, f: float, periods: float) -> None:
    """Reject a window with too many samples, before anything is computed."""
    samples = length / interval(run)
    if not samples <= MOST_SAMPLES:
        lowest = periods / (MOST_SAMPLES * interval(run))
        raise ParameterError(
            f"frequency = {shown(f, 'Hz')} is too low: its window would have {samples:.3g} "
            f"samples, but the limit is {MOST_SAMPLES:.0e}. Use frequencies "
            f">= {shown(float(f'{lowest:.2g}'), 'Hz')}, or a lower sample rate",
            name="frequency",
            value=shown(f, "Hz"),
            valid=f">= {shown(float(f'{lowest:.2g}'), 'Hz')}",
        )


def line_window(run: Run, sweep: Sweep) -> tuple[float, list[int]]:
    """Return length [s] of a window with a line near every frequency, and their numbers.

    Frequencies are multiples of 1/length, with at least one other line between two of them.

    Raises
    ------
    ParameterError
        When the frequencies do not ascend, or one is so low that its window is too long.
    """
    f = list(sweep.frequencies)
    apart = [b - a for a, b in itertools.pairwise(f)]
    if any(step <= 0 for step in apart):
        raise not_valid("frequencies", str(f), "in ascending order")
    common = common_interval(run, sweep.whole)
    wanted = max(max(sweep.least, _LOWEST) / f[0], sweep.shortest, *(2.0 / step for step in apart))
    # Half a line more, so that after rounding, neighbors still have a line between them.
    _require_short(run, wanted * 1.25, f[0], wanted * 1.25 * f[0])
    length = math.ceil(wanted * 1.25 / common) * common
    return length, [math.floor(frequency * length + 0.5) for frequency in f]


def kept(figures: Complex, settled: NDArray[np.bool_]) -> np.ma.MaskedArray[Any, Any]:
    """Return the windows that count: a repeating response's last two, otherwise all stored ones.

    Parameters
    ----------
    figures
        Complex amplitudes of the last windows, shape (cases, KEPT, lines); see
        ``simulation.repetition``.
    settled
        Mask of the cases that repeat, shape (cases,).
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
        Amplitudes, shape (cases, lines): those of the last window if they repeat, otherwise the
        mean of the windows that count. Their scatter, relative to the amplitude: root mean square
        of the windows' distances from their mean. A drift is treated as scatter.
    """
    seen = kept(figures, settled)
    mean = seen.mean(axis=1)
    apart = np.sqrt((np.abs(seen - mean[:, None]) ** 2).mean(axis=1))
    value = np.where(settled[:, None], figures[:, -1], np.ma.filled(mean, np.nan))
    with np.errstate(invalid="ignore", divide="ignore"):
        return value, np.asarray(np.ma.filled(apart, np.nan) / np.abs(value))
