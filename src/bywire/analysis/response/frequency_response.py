"""Frequency response of a nonlinear sampled loop, with single sines or all frequencies at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.response.sweep import (
    Cases,
    Sweep,
    as_dataset,
    cases_of,
    interval,
    kept,
    line_window,
    require_measurable,
    sine_window,
    spread_of,
)
from bywire.core.errors import ParameterError, not_valid
from bywire.core.interrupts import thread_pool
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex, Progress
from bywire.simulation.repetition import Repeated, repeat
from bywire.simulation.run import Run

if TYPE_CHECKING:
    import xarray as xr

HARMONICS = 9
"""highest harmonic that is treated as distortion"""
STILL = 1e-12
"""maximum peak-to-peak value of an output at rest, relative to its usual magnitude"""


def require_stable(closed: LinearModel) -> None:
    """Reject an unstable loop.

    Raises
    ------
    ParameterError
        When the loop is unstable, with its poles.
    """
    if closed.is_stable:
        return
    outside = [z for z in closed.poles() if abs(z) > 1.0]
    rates = ", ".join(f"{math.log(abs(z)) / closed.period:.3g}" for z in outside)
    raise ParameterError(
        f"{closed.name}: the closed loop is unstable, so it has no frequency response. The growth "
        f"rates of its unstable poles are {rates} 1/s",
        name=closed.name,
    )


def frequency_response(
    run: Run,
    sweep: Sweep,
    progress: Progress | None = None,
    *,
    points: Sequence[Run] | None = None,
    lanes: bool = True,
) -> xr.Dataset:
    """Measure the response at every frequency, amplitude and variant.

    Parameters
    ----------
    run
        The loop: model, parameters, start, and the stimulus, whose value at time zero is the mean
        of the sine. Its duration and recording interval are not used.
    sweep
        Frequencies, amplitudes and variants.
    progress
        Called with ``"frequency response"`` and the finished share, 0 to 1.
    points
        Variants with their own operating points, instead of the sweep's variations: runs of the
        same model with the same choices and sample times.
    lanes
        False to run one sine after another on one core, as in a simulator without ensembles.

    Returns
    -------
    xarray.Dataset
        Dimensions ``variant``, ``amplitude``, ``frequency`` [Hz]; variables ``gain`` (ratio of
        output to input, SI), ``phase`` [degree], ``distortion`` (total harmonic, as a fraction),
        ``coherence`` (fraction of the output's power at the excited line, without the mean),
        ``scatter`` (of the complex amplitude; see `spread_of`), ``windows``, ``settled`` (0 or 1),
        and ``share_FLAG`` for every flag and saturation. Gain and phase are NaN if the output does
        not move, because a stuck mechanism has no gain. If the output never repeats, they are
        means over the last windows.

    Raises
    ------
    UnknownNameError
        When a signal is unknown.
    ParameterError
        When frequencies or amplitudes are not positive, or a frequency is above half the rate at
        which the slowest controller samples.
    SolverError
        When a value of a trajectory is infinite or NaN.
    """
    require_measurable(run, sweep)
    cases = cases_of(run, sweep, points)
    plans = [sine_window(run, f, sweep) for f in sweep.frequencies]
    names = list(run.par.leaves())
    least = STILL * signals_of(run.model.Output)[sweep.output].nominal

    def measure(plan: tuple[float, int]) -> dict[str, Array]:
        window, periods = plan
        windowed = replace(run, duration=window, record=interval(run))
        repeated = _repeated(windowed, sweep, cases, periods, lanes)
        measured = _measured(repeated, cases.sizes, periods, least)
        measured |= sweep.shares(repeated.values, cases.matrix, names)
        return {name: value.reshape(cases.shape) for name, value in measured.items()}

    done: list[dict[str, Array]] = []
    with thread_pool(None if lanes else 1) as pool:
        for k, figures in enumerate(pool.map(measure, plans)):
            done.append(figures)
            if progress is not None:
                progress("frequency response", (k + 1) / len(plans))
    return as_dataset(run, sweep, [periods / window for window, periods in plans], done)


def _repeated(windowed: Run, sweep: Sweep, cases: Cases, periods: int, lanes: bool) -> Repeated:
    """Run all amplitudes and variants at one frequency until they repeat."""
    columns = [windowed.model.Stimulus._fields.index(name) for name in sweep.inputs]
    schedule = windowed.schedule()
    apart, f = schedule.stimulus_frames * schedule.frame, periods / windowed.duration

    def sines(which: NDArray[np.int64], first: int, last: int) -> Array:
        rows = np.repeat(cases.rest[which, None], last - first, axis=1)
        wave = np.sin(2.0 * math.pi * f * (np.arange(first, last) * apart))
        rows[:, :, columns] += (cases.sizes[which, None] * wave)[:, :, None]
        return rows

    rows = round(windowed.duration / windowed.record)
    wave = 2j / rows * np.exp(-2j * math.pi * periods / rows * np.arange(rows))

    def figures(window: Array) -> Complex:
        # A matrix product would start a linear algebra library's threads within ours.
        return np.asarray(np.einsum("lr,r->l", window[:, :, 0], wave)[:, None])

    return repeat(
        windowed,
        cases.matrix,
        sines,
        sweep.recorded,
        figures,
        sweep.tolerance,
        sweep.most,
        starts=cases.starts,
        lanes=lanes,
    )


def _measured(repeated: Repeated, sizes: Array, periods: int, least: float) -> dict[str, Array]:
    """Return the figures of all cases at one frequency, shape (cases,) each."""
    outputs = repeated.values[:, :, 0]
    count = max(min(HARMONICS, outputs.shape[1] // (2 * periods)), 1)
    # The window contains whole periods, so harmonics are lines of its Fourier transform.
    spectrum = np.fft.rfft(outputs, axis=1)[:, periods : count * periods + 1 : periods]
    lines = 2.0 / outputs.shape[1] * spectrum
    moves = np.ptp(outputs, axis=1) > least
    last = np.where(moves, np.abs(lines[:, 0]), np.nan)
    value, scatter = (column[:, 0] for column in spread_of(repeated.figures, repeated.repeats))
    return {
        "gain": np.where(moves, np.abs(value), np.nan) / sizes,
        "phase": np.where(moves, np.degrees(np.angle(value)), np.nan),
        "distortion": np.sqrt(np.sum(np.abs(lines[:, 1:]) ** 2, axis=1)) / last,
        "coherence": 0.5 * last**2 / np.where(moves, np.var(outputs, axis=1), np.nan),
        "scatter": np.where(moves, scatter, np.nan),
        "windows": repeated.windows.astype(float),
        "settled": repeated.repeats.astype(float),
        "unsettled_substeps": repeated.unsettled.astype(float),
    }


# --- Numerical error of a measured response, from the same response with half the step

FIGURES = (
    "gain",
    "phase",
    "bandwidth",
    "crossover",
    "phase_margin",
    "gain_margin",
    "lower_gain_margin",
)
"""figures with an error; phases and phase margins are in degrees"""


def with_step_errors(response: xr.Dataset, finer: xr.Dataset, share: float) -> xr.Dataset:
    """Return a measured response with its figures' errors due to the step.

    Parameters
    ----------
    response
        Response with its widths; see `bywire.analysis.response.large_signal.with_widths`.
    finer
        The same response with smaller steps.
    share
        Ratio of the error to the difference of both; see `bywire.bench.step_error.of_difference`.

    Returns
    -------
    xarray.Dataset
        Response with ``NAME_step_error`` for each figure, in its unit: NaN if neither response has
        the figure, infinite if only one has it. Responses that never repeat also count, since the
        gain of a limit cycle differs.
    """
    return response.assign(
        {
            f"{name}_step_error": (
                response[name].dims,
                share * _apart(response[name].values, finer[name].values, name),
                dict(response[name].attrs),
            )
            for name in FIGURES
        }
    )


def _apart(value: Array, other: Array, name: str) -> Array:
    """Return distances, without whole turns of phases; 0 if both values are beyond the band."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(value - other)
    if name == "phase":
        apart = np.abs(np.mod(apart + 180.0, 360.0) - 180.0)
    apart = np.where(
        np.isnan(value) & np.isnan(other), np.nan, np.nan_to_num(apart, nan=np.inf, posinf=np.inf)
    )
    return np.where(np.isinf(value) & np.isinf(other), 0.0, apart)


def largest(response: xr.Dataset) -> str:
    """Return a sentence on the maximum errors due to the step; empty without errors."""
    if "gain_step_error" not in response:
        return ""
    with np.errstate(invalid="ignore"):
        relative = response["gain_step_error"].values / response["gain"].values
    known = relative[np.isfinite(relative)]
    if not known.size:
        return ""
    decibel = 20.0 * float(np.log10(1.0 + known.max()))
    phase = response["phase_step_error"].values
    degree = float(phase[np.isfinite(phase)].max())
    return f"numerical error due to the step: up to {decibel:.1g} dB and {degree:.1g}°"


# --- All frequencies at once

MOST = 12
"""maximum number of windows of a response, since windows are long here"""


@dataclass(frozen=True)
class Broadband:
    """Periodic excitation with many frequencies.

    Parameters
    ----------
    kind
        ``"multisine"``: the requested frequencies with equal amplitudes and random phases.
        ``"chirp"``: a periodic sine whose frequency rises exponentially from the lowest to the
        highest requested frequency.
    seed
        Seed of the random phases.
    realizations
        Number of multisines with different phases to average; all chirps are equal.
    """

    kind: Literal["multisine", "chirp"] = "multisine"
    seed: int = 0
    realizations: int = 4

    @property
    def count(self) -> int:
        """Number of different excitations."""
        return self.realizations if self.kind == "multisine" else 1


def broadband_response(
    run: Run,
    sweep: Sweep,
    excitation: Broadband,
    progress: Progress | None = None,
    *,
    points: Sequence[Run] | None = None,
) -> xr.Dataset:
    r"""Measure the response at all frequencies at once, for every amplitude and variant.

    .. math:: G_k = \frac{\sum Y_k U_k^*}{\sum |U_k|^2}, \quad
        \gamma_k^2 = \frac{|\sum Y_k U_k^*|^2}{\sum |U_k|^2 \sum |Y_k|^2}

    over the realizations and the last windows. For a nonlinear loop, G is the best linear
    approximation for an excitation of this kind and size. It is not the response to a sine of this
    amplitude, because all frequencies share the range within a limit.

    Parameters
    ----------
    run
        As in ``frequency_response``.
    sweep
        Frequencies, rounded to multiples of the inverse window length; amplitudes are peaks of the
        whole excitation, in all realizations.
    excitation
        Kind of excitation.
    progress
        Called with ``"frequency response"`` and the finished share, 0 to 1.
    points
        As in ``frequency_response``.

    Returns
    -------
    xarray.Dataset
        As from ``frequency_response``, but ``coherence`` is as above. ``distortion`` is the
        output's root mean square at the unexcited lines within the band that are nearest to this
        frequency, relative to that at this frequency; NaN for a chirp, which excites all lines.
        ``scatter`` is over the windows of one realization. Results of whole runs are the same at
        all frequencies. The attribute ``rms`` is the ratio of the excitation's root mean square to
        its amplitude, ``window`` the window's length [s].

    Raises
    ------
    InputError
        As in ``frequency_response``, and when frequencies do not ascend or there is no realization.
    SolverError
        When a value of a trajectory is infinite or NaN.
    """
    require_measurable(run, sweep)
    if excitation.count < 1:
        raise not_valid("realizations", str(excitation.realizations), ">= 1")
    if progress is not None:
        progress("frequency response", 0.0)
    length, lines = line_window(run, sweep)
    windowed = replace(run, duration=length, record=interval(run))
    shapes = _excitations(windowed, lines, excitation)
    cases = cases_of(windowed, sweep, points)
    repeated = _repeated_multisines(windowed, sweep, cases, shapes, lines)
    shape = (*cases.shape, len(shapes))
    measured = _measured_lines(
        repeated, shapes, lines, shape, np.asarray(sweep.amplitudes, dtype=float)
    )
    if excitation.kind == "chirp":
        measured["distortion"] = np.full_like(measured["distortion"], np.nan)
    matrix = np.repeat(cases.matrix, len(shapes), axis=1)
    shares = sweep.shares(repeated.values, matrix, list(run.par.leaves()))
    measured |= _of_runs(repeated, shares, shape, len(lines))
    if progress is not None:
        progress("frequency response", 1.0)
    done = [{k: v[:, :, j] for k, v in measured.items()} for j in range(len(lines))]
    dataset = as_dataset(run, sweep, [k / length for k in lines], done)
    return dataset.assign_attrs(
        excitation=excitation.kind,
        seed=excitation.seed,
        realizations=excitation.count,
        window=length,
        rms=float(np.sqrt(np.mean(shapes**2))),
    )


def _excitations(windowed: Run, lines: list[int], excitation: Broadband) -> Array:
    """Return excitations with peak 1 and equal root mean square, shape (realizations, samples)."""
    t = windowed.schedule().stimulus_times[:-1]
    if excitation.kind == "chirp":
        return _chirp(t / windowed.duration, lines)[None]
    draw = np.random.default_rng(excitation.seed)
    shapes = np.empty((excitation.count, t.size))
    for shape in shapes:
        spectrum = np.zeros(t.size // 2 + 1, dtype=np.complex128)
        spectrum[lines] = np.exp(2j * math.pi * draw.random(len(lines)))
        shape[:] = np.fft.irfft(spectrum, t.size)
    return np.asarray(shapes / np.abs(shapes).max())


def _chirp(share: Array, lines: list[int]) -> Array:
    """Return a sine with rising frequency over the window, periodic and with peak 1.

    Components outside the band are removed, since slow controllers would alias them into it.
    """
    ratio = max(lines[-1] / lines[0], 1.0 + 1e-9)
    turns = lines[0] * (ratio**share - 1.0) / math.log(ratio)
    whole = lines[0] * (ratio - 1.0) / math.log(ratio)
    spectrum = np.fft.rfft(np.sin(2.0 * math.pi * turns * max(round(whole), 1) / whole))
    spectrum[: lines[0]] = spectrum[lines[-1] + 1 :] = 0.0
    cut = np.fft.irfft(spectrum, share.size)
    return np.asarray(cut / np.abs(cut).max())


def _repeated_multisines(
    windowed: Run, sweep: Sweep, cases: Cases, shapes: Array, lines: list[int]
) -> Repeated:
    """Run all variants, amplitudes and realizations, in this order, until they repeat."""
    columns = [windowed.model.Stimulus._fields.index(name) for name in sweep.inputs]
    n = len(shapes)

    def excited(which: NDArray[np.int64], first: int, last: int) -> Array:
        rows = np.repeat(cases.rest[which // n, None], last - first, axis=1)
        waves = cases.sizes[which // n, None] * shapes[which % n, first:last]
        rows[:, :, columns] += waves[:, :, None]
        return rows

    def figures(window: Array) -> Complex:
        return np.asarray(np.fft.rfft(window[:, :, 0], axis=1)[:, lines])

    return repeat(
        windowed,
        np.repeat(cases.matrix, n, axis=1),
        excited,
        sweep.recorded,
        figures,
        sweep.tolerance,
        min(sweep.most, MOST),
        starts=[start for start in cases.starts for _ in range(n)],
    )


def _measured_lines(
    repeated: Repeated, shapes: Array, lines: list[int], shape: tuple[int, int, int], sizes: Array
) -> dict[str, Array]:
    """Return the figures at the lines, shape (variants, amplitudes, lines) each."""
    U = sizes[:, None, None] * np.fft.rfft(shapes, axis=1)[:, lines]
    windows = kept(repeated.figures, repeated.repeats)
    Y = windows.reshape(*shape, *windows.shape[1:])
    over = (2, 3)  # realizations and windows
    cross = np.ma.sum(Y * U[None, :, :, None].conj(), axis=over)
    put = np.ma.sum(np.abs(U[None, :, :, None]) ** 2 * ~np.ma.getmaskarray(Y), axis=over)
    power = np.ma.sum(np.abs(Y) ** 2, axis=over)
    moves = (np.ptp(repeated.values[:, :, 0], axis=1) > 0).reshape(shape).any(axis=2)[:, :, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        G = np.where(moves, np.ma.filled(cross / put, np.nan), np.nan)
        coherence = np.ma.filled(np.abs(cross) ** 2 / (put * power), np.nan)
        _, scatter = spread_of(repeated.figures, repeated.repeats)
        scattered = np.sqrt((scatter.reshape(*shape, -1) ** 2).mean(axis=2))
    return {
        "gain": np.abs(G),
        "phase": np.degrees(np.angle(G)),
        "distortion": np.where(moves, _distortion(repeated, lines, shape), np.nan),
        "coherence": np.where(moves, coherence, np.nan),
        "scatter": np.where(moves, scattered, np.nan),
    }


def _distortion(repeated: Repeated, lines: list[int], shape: tuple[int, int, int]) -> Array:
    """Return the ratio of unexcited lines nearby to each excited line, from the last window."""
    power = np.abs(np.fft.rfft(repeated.values[:, :, 0], axis=1)[:, : lines[-1] + 1]) ** 2
    power = power.reshape(*shape, -1).mean(axis=2)
    at = power[:, :, lines]
    power[:, :, lines] = 0.0
    middles = [math.ceil((a + b) / 2) for a, b in pairwise(lines)]
    near = np.add.reduceat(power, [lines[0], *middles], axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.sqrt(near / at))


def _of_runs(
    repeated: Repeated, shares: Mapping[str, Array], shape: tuple[int, int, int], lines: int
) -> dict[str, Array]:
    """Return results of whole runs: the worst of their realizations, and means of fractions."""
    known = {
        "windows": repeated.windows.reshape(shape).max(axis=2),
        "settled": repeated.repeats.reshape(shape).min(axis=2),
        "unsettled_substeps": repeated.unsettled.reshape(shape).sum(axis=2),
        **{name: share.reshape(shape).mean(axis=2) for name, share in shares.items()},
    }
    return {k: np.repeat(v.astype(float)[:, :, None], lines, axis=2) for k, v in known.items()}
