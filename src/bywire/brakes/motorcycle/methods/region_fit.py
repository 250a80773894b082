"""Fit of eq. (22) to current and pressure records with dither, in each pressure region."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.motorcycle.linear import two_pole
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.confidence import notes_of, uncertainty
from bywire.identification.estimate import Estimate, Kept
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown, moved

if TYPE_CHECKING:
    import xarray as xr

Complex = NDArray[np.complex128]

_LEAST = 0.1  # minimum height of a peak that is treated as a line, relative to the strongest line
_FINER = 4  # zero padding of the transform that detects the lines
_ROUNDS = 5  # Newton iterations for their frequencies
_STILL = 1e-9  # relative to a signal's magnitude: a smaller change is rounding
_HARMONICS = 3  # of the dither


@dataclass(frozen=True)
class Points:
    """A measured frequency response.

    Parameters
    ----------
    frequencies
        [Hz], shape (n,).
    log_gain
        Logarithm of the output-to-input ratio, SI: magnitude in the real part, phase [rad] in the
        imaginary part; shape (n,).
    deviation
        Standard deviation of each part, from both signals' residuals; shape (n,).
    """

    frequencies: Array
    log_gain: Complex
    deviation: Array


def lines(
    u: Array, interval: float, low: float, high: float, others: Sequence[float] = ()
) -> Array:
    """Return the frequencies [Hz] of a signal's sines within a band, shape (n,).

    ``u``: shape (rows,); ``interval``: sample time [s]; ``low``, ``high``: limits of the band [Hz];
    ``others``: lines outside the band, with three harmonics, such as a dither [Hz].
    """
    n = u.size
    t = _centered(n, interval)
    base = np.column_stack((_waves(_harmonics(others, interval), t), np.ones(n), t))
    flat = u - base @ np.linalg.lstsq(base, u, rcond=None)[0]
    if not np.ptp(flat) > _STILL * np.abs(u).max():
        return np.empty(0)
    size = _FINER * n
    spectrum = np.abs(np.fft.rfft(flat * np.hanning(n), size))
    f = np.fft.rfftfreq(size, interval)
    inside = (f >= low - 0.5 / (n * interval)) & (f <= high + 0.5 / (n * interval))
    if not inside.any():
        return np.empty(0)
    peaks = 1 + np.flatnonzero((spectrum[1:-1] >= spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:]))
    strong = peaks[inside[peaks] & (spectrum[peaks] > _LEAST * spectrum[inside].max())]
    # A window has side lobes: a peak within the main lobe of a stronger line does not count.
    kept: list[int] = []
    for k in sorted(strong, key=lambda k: -spectrum[k]):
        if all(abs(k - other) > 2 * _FINER for other in kept):
            kept.append(int(k))
    return _refined(u, t, np.sort(f[kept]), base)


def _refined(u: Array, t: Array, frequencies: Array, base: Array) -> Array:
    """Return the sine frequencies that minimize a signal's residual (Gauss-Newton)."""
    w = 2.0 * math.pi * frequencies
    for _ in range(_ROUNDS):
        waves = _waves(w, t)
        k = waves.shape[1]
        a = np.linalg.lstsq(np.column_stack((waves, base)), u, rcond=None)[0][:k]
        slopes = t[:, None] * (-a[0::2] * waves[:, 1::2] + a[1::2] * waves[:, 0::2])
        all_columns = np.column_stack((slopes, waves, base))
        w = w + np.linalg.lstsq(all_columns, u, rcond=None)[0][: w.size]
    return np.asarray(w / (2.0 * math.pi))


def _centered(rows: int, interval: float) -> Array:
    return np.asarray(interval * (np.arange(rows) - 0.5 * (rows - 1)))


def _harmonics(frequencies: Sequence[float], interval: float) -> Array:
    """Return harmonics [rad/s] below half the sample rate."""
    orders = [k * f for f in frequencies for k in range(1, _HARMONICS + 1)]
    return 2.0 * math.pi * np.array([f for f in orders if f < 0.5 / interval])


def _waves(w: Array, t: Array) -> Array:
    """Return cosine and sine of every frequency [rad/s], alternating, shape (rows, 2 n)."""
    angle = np.outer(t, w)
    return np.stack((np.cos(angle), np.sin(angle)), axis=2).reshape(t.size, -1)


def _mixed(carriers: Array, alone: Array) -> Array:
    """Return carriers and their sidebands [rad/s]: a dither's amplitude follows the pressure."""
    sides = [np.concatenate((w - alone, [w], w + alone)) for w in carriers]
    return np.concatenate(sides) if sides else np.empty(0)


def measured_points(
    u: Array, y: Array, interval: float, frequencies: Array, others: Sequence[float] = ()
) -> Points:
    """Return the output-to-input ratio at certain lines, without drift and other lines.

    ``u``, ``y``: input and output in steady state, shape (rows,); ``interval``: sample time [s];
    ``frequencies``: lines [Hz]; ``others``: other lines of both signals, with three harmonics,
    such as a dither [Hz].
    """
    t = _centered(u.size, interval)
    omega = 2.0 * math.pi * frequencies
    w = np.concatenate((omega, _mixed(_harmonics(others, interval), omega)))
    columns = np.column_stack((_waves(w, t), np.ones(t.size), t))
    both = np.column_stack((u, y))
    coefficients, _, _, _ = np.linalg.lstsq(columns, both, rcond=None)
    left = both - columns @ coefficients
    variance = np.sum(left**2, axis=0) / max(u.size - columns.shape[1], 1)
    n = frequencies.size
    amplitude = coefficients[: 2 * n : 2] - 1j * coefficients[1 : 2 * n : 2]
    relative = 2.0 * variance / u.size / np.abs(amplitude) ** 2
    # Each part contains half of the variance of a complex amplitude's error.
    return Points(
        frequencies, np.log(amplitude[:, 1] / amplitude[:, 0]), np.sqrt(relative.sum(axis=1))
    )


# --- Records

REGIONS = ("low", "medium", "high")
BAND = (1.0, 15.0)
"""frequencies [Hz] of the paper's second step"""

_STEP = 0.9  # fraction of the demand's variance that two levels must explain (sine: at most 0.81)
_REST = 10  # minimum number of blocks of rest before a step
_LONGEST = 0.1  # s: maximum duration of a block of dither periods


@dataclass(frozen=True)
class StepRecord:
    """A current step from rest, with the dither averaged out.

    Parameters
    ----------
    label
        Name of the record.
    u
        Current minus its mean before the step [A], as a moving average over a block, starting at
        the end of the first block, shape (n - block + 1,).
    interval
        Sample time [s].
    block
        Samples per pressure mean: whole dither periods.
    pressure
        Mean pressure in every block [Pa], shape (n // block,).
    rest
        Mean pressure before the step [Pa].
    sigma
        Standard deviation of a block's noise [Pa].
    sigma_i
        Standard deviation of a current sample's noise [A].
    before
        Samples before the step.
    """

    label: str
    u: Array
    interval: float
    block: int
    pressure: Array
    rest: float
    sigma: float
    sigma_i: float
    before: int


@dataclass(frozen=True)
class Region:
    """All records of a pressure region.

    ``name``: ``low``, ``medium`` or ``high``; ``steps``: step records; ``points``: frequency
    response of all sine records; ``pressure``: mean pressure [Pa].
    """

    name: str
    steps: tuple[StepRecord, ...]
    points: Points
    pressure: float


def regions_of(
    records: Mapping[str, xr.Dataset], borders: tuple[float, float], f_dit: float | None
) -> tuple[Region, ...]:
    """Sort the records by pressure region and kind.

    Parameters
    ----------
    records
        ``i`` [A] and ``p_mc`` [Pa] over ``time`` [s], by label. A record is a step if two levels
        explain its current. Otherwise it has one or several simultaneous sines in steady state.
    borders
        Boundaries between low and medium pressure, and between medium and high pressure [Pa].
    f_dit
        Frequency of the dither [Hz]; None if it is off.

    Raises
    ------
    ParameterError
        When time is not evenly spaced, a dither period is not a whole number of samples, no rest
        precedes a step, or a record contains neither a step nor a sine.
    """
    steps: dict[str, list[StepRecord]] = {name: [] for name in REGIONS}
    points: dict[str, list[Points]] = {name: [] for name in REGIONS}
    levels: dict[str, list[float]] = {name: [] for name in REGIONS}
    for label, data in records.items():
        i, p = data["i"].values, data["p_mc"].values
        interval = even_interval(data["time"].values)
        block = block_of(interval, f_dit)
        mean = float(p.mean())
        region = REGIONS[int(np.searchsorted(borders, mean, side="right"))]
        levels[region].append(mean)
        i_mean = averaged(i, block)
        onset = step_at(i_mean)
        if onset is not None:
            steps[region].append(_step(label, i, p, interval, block, onset))
        else:
            points[region].append(_sines(label, i, p, interval, f_dit))
    return tuple(
        Region(name, tuple(steps[name]), _together(points[name]), float(np.mean(levels[name])))
        for name in REGIONS
        if levels[name]
    )


def block_of(interval: float, f_dit: float | None) -> int:
    """Return the number of samples in one or a few whole dither periods.

    Raises
    ------
    ParameterError
        When no such number exists.
    """
    if f_dit is None:
        return max(round(0.02 / interval), 1)
    for periods in range(1, max(int(_LONGEST * f_dit), 1) + 1):
        samples = periods / (f_dit * interval)
        if round(samples) >= 2 and abs(samples - round(samples)) < 1e-3:
            return round(samples)
    raise ParameterError(
        f"one or a few dither periods of {1.0 / f_dit:g} s must be a whole number of sample times "
        f"of {interval:g} s, so that the ripple averages out. Resample the record to 1 kHz",
        name="sample time",
        value=f"{interval:g} s",
    )


def averaged(values: Array, block: int) -> Array:
    """Return the mean of every block, shape (n // block,)."""
    count = values.size // block
    return np.asarray(values[: count * block].reshape(count, block).mean(axis=1))


def _moving_average(values: Array, block: int) -> Array:
    """Return the moving mean over the last samples, starting at the end of the first whole block.

    Averaging current and pressure the same way preserves their relation and removes the dither.
    """
    return np.convolve(values, np.full(block, 1.0 / block), mode="valid")


def step_at(means: Array) -> int | None:
    """Return the first block after the current step, from the best fit of two levels, or None."""
    n = means.size
    if n < 3:
        return None
    total = np.sum((means - means.mean()) ** 2)
    k = np.arange(1, n)
    left = np.cumsum(means)[:-1]
    between = (left - k * means.mean()) ** 2 * n / (k * (n - k))
    best = int(np.argmax(between))
    moves = np.ptp(means) > _STILL * np.abs(means).max()
    return best + 1 if moves and between[best] > _STEP * total else None


def _step(label: str, i: Array, p: Array, interval: float, block: int, onset: int) -> StepRecord:
    rest = onset - 1  # the block with the step belongs to neither level
    if rest < _REST:
        least = f">= {_REST * block * interval:g} s"
        raise ParameterError(
            f"record {label or 'with the step'}: the rest before the step lasts "
            f"{max(rest, 0) * block * interval:g} s. It must be {least} to show the initial "
            "pressure. Start recording earlier",
            name="rest",
            value=f"{max(rest, 0) * block * interval:g} s",
            valid=least,
        )
    before = slice(0, rest * block)
    means = averaged(p, block)
    noise = _around_line(averaged(i[before], block)) * math.sqrt(block)
    return StepRecord(
        label,
        _moving_average(i - float(i[before].mean()), block),
        interval,
        block,
        means,
        float(p[before].mean()),
        _scatter(means),
        noise,
        rest * block,
    )


def _scatter(means: Array) -> float:
    """Return the noise of slowly varying values, from their second differences."""
    second = np.diff(means, 2)
    return max(float(np.median(np.abs(second))) / (0.6745 * math.sqrt(6.0)), 1e-9)


def _around_line(means: Array) -> float:
    """Return the noise of values that otherwise only drift."""
    k = np.arange(means.size)
    left = means - np.polyval(np.polyfit(k, means, 1), k)
    return math.sqrt(float(left @ left) / (means.size - 2))


def _sines(label: str, i: Array, p: Array, interval: float, f_dit: float | None) -> Points:
    others = () if f_dit is None else (f_dit,)
    spectrum = lines(i, interval, *BAND, others)
    if not spectrum.size:
        raise ParameterError(
            f"the current of record {label} contains neither a step nor a sine from {BAND[0]:g} to "
            f"{BAND[1]:g} Hz, so it does not determine any unknown. Apply a step or a sine to the "
            "current demand",
            name="i",
        )
    return measured_points(i, p, interval, spectrum, others)


def _together(points: Sequence[Points]) -> Points:
    if not points:
        return Points(np.empty(0), np.empty(0, complex), np.empty(0))
    f, log_gain, deviation = (
        np.concatenate([getattr(points_of, name) for points_of in points])
        for name in ("frequencies", "log_gain", "deviation")
    )
    order = np.argsort(f)
    return Points(f[order], log_gain[order], deviation[order])


# --- The fit

NAMES = ("K", "tau_L", "T1", "T2", "T_L")
"""gain and time constants of eq. (22), in the order of the paper's xi"""

_STATES, _INPUTS = 6, 2


def response(values: Array, u: Array, interval: float, every: int) -> tuple[Array, Array]:
    r"""Return the response and its derivatives at every nth sample.

    .. math::
        G = K \frac{1 + s \tau_L}{(1 + s T_1)(1 + s T_2)(1 + s T_L)}, \quad
        \frac{\partial y}{\partial T_k} = -\frac{s}{1 + s T_k} y

    The system starts at rest. The discretization is exact for an input that is linear between
    samples.

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L; SI, shape (5,).
    u
        Input minus its value at rest, shape (n,).
    interval
        Sample time [s].
    every
        Samples from one returned row to the next; the first row is at the start.

    Returns
    -------
    tuple
        Response, shape (1 + (n - 1) // every,), and derivatives, shape (..., 5).

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (22).
    """
    A, B = _realization(values)
    Phi, now, later = _first_order_hold(A, B, interval)
    blocks = (u.size - 1) // every
    begin = u[: blocks * every].reshape(blocks, every)
    end = u[1 : blocks * every + 1].reshape(blocks, every)
    powers = [np.eye(_STATES)]
    for _ in range(every):
        powers.append(Phi @ powers[-1])
    onward = np.array(powers[:every][::-1])
    gain = begin @ (onward @ now) + end @ (onward @ later)
    states = np.zeros((blocks + 1, _STATES))
    for k in range(blocks):
        states[k + 1] = powers[every] @ states[k] + gain[k]
    z = states @ _outputs(values).T
    return z[:, 0], z[:, 1:]


def _impulse(values: Array, n: int, interval: float) -> Array:
    """Return the response of samples to one sample of the input, shape (n,).

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L; SI, shape (5,).
    n
        Samples.
    interval
        Sample time [s].
    """
    u = np.zeros(n + 1)
    u[1] = 1.0  # within the record: a triangular pulse around this sample
    return response(values, u, interval, 1)[0][1:]


def _realization(values: Array) -> tuple[Array, Array]:
    """Return the chain of lags, with one additional output lag for each time constant."""
    K, tau_L, T_1, T_2, T_L = values
    A, B = np.zeros((_STATES, _STATES)), np.zeros(_STATES)
    lags = (T_1, T_2, T_L)
    for k, T in enumerate(lags):
        A[k, k] = -1.0 / T
        if k:
            A[k, k - 1] = 1.0 / T
    B[0] = 1.0 / T_1
    y = _output_row(K, tau_L, T_L)
    for k, T in enumerate(lags):
        A[3 + k] = y / T
        A[3 + k, 3 + k] -= 1.0 / T
    return A, B


def _output_row(K: float, tau_L: float, T_L: float) -> Array:
    row = np.zeros(_STATES)
    row[1], row[2] = K * tau_L / T_L, K * (1.0 - tau_L / T_L)
    return row


def _outputs(values: Array) -> Array:
    """Return rows of the output and of its derivatives with respect to the five values."""
    K, tau_L, T_1, T_2, T_L = values
    y = _output_row(K, tau_L, T_L)
    rows = [y, y / K, _output_row(K, 1.0, T_L) - _output_row(K, 0.0, T_L)]
    for k, T in enumerate((T_1, T_2, T_L)):
        row = -y / T
        row[3 + k] += 1.0 / T
        rows.append(row)
    return np.array(rows)


def _first_order_hold(A: Array, B: Array, interval: float) -> tuple[Array, Array, Array]:
    """Return the transition matrix, and the input's weights at the start and end of an interval."""
    from scipy import linalg

    n = _STATES
    M = np.zeros((n + _INPUTS, n + _INPUTS))
    M[:n, :n], M[:n, n], M[n, n + 1] = A * interval, B * interval, 1.0
    E = linalg.expm(M)
    held, risen = E[:n, n], E[:n, n + 1]
    return E[:n, :n], held - risen, risen


def log_response(values: Array, frequencies: Array) -> tuple[NDArray[np.complex128], Array]:
    r"""Return :math:`\ln G` at frequencies [Hz], and its derivatives, complex.

    The real part is the logarithm of the magnitude; the imaginary part is the phase [rad].

    Returns
    -------
    tuple
        Shapes (n,) and (n, 5).
    """
    s = 2j * math.pi * frequencies
    K, tau_L, T_1, T_2, T_L = values
    G = np.log(K) + np.log(1.0 + s * tau_L) - sum(np.log(1.0 + s * T) for T in (T_1, T_2, T_L))
    slopes = [np.full(s.size, 1.0 / K + 0j), s / (1.0 + s * tau_L)]
    slopes += [-s / (1.0 + s * T) for T in (T_1, T_2, T_L)]
    return np.asarray(G), np.column_stack(slopes)


# --- Two fits that share unknowns and alternate until they agree

_SETTLED = 1e-6  # of a value


def _in_turn(
    problems: tuple[Problem, Problem], groups: tuple[Sequence[int], Sequence[int]], most: int
) -> Estimate:
    r"""Estimate some unknowns with one fit and the rest with another, using each other's values.

    At the end :math:`Z^T r = 0`, where Z contains each fit's derivatives with respect to its own
    unknowns only. This is an instrumental-variable estimate. Its covariance includes the effect of
    one fit's error on the other.

    Parameters
    ----------
    problems
        Both with the same unknowns.
    groups
        Indices of the unknowns that each fit estimates; together they cover all unknowns.
    most
        Maximum number of iterations. With one, the first fit does not use the second fit's values.

    Raises
    ------
    ParameterError
        When the data determine none of a fit's unknowns.
    """
    unknowns = problems[0].unknowns
    values = np.array([u.start for u in unknowns])
    parts: list[Estimate] = []
    turns, change = 0, np.inf
    while turns < most and change > _SETTLED:
        before = values.copy()
        parts = []
        for problem, mine in zip(problems, groups, strict=True):
            part = estimate(restricted(problem, mine, values))
            values[[_index(problem, label) for label in part.names]] = part.values
            parts.append(part)
        size = np.abs(values) + np.array([u.scale for u in unknowns])
        change, turns = float(np.max(np.abs(values - before) / size)), turns + 1
    notes = [f"{turns} iteration{'s' if turns > 1 else ''} of the two-step fit"]
    if change <= _SETTLED:
        best = _combined(problems, parts, values)
    else:
        best = _apart(problems, parts)
        notes.append(
            "the two-step fit did not converge: its last iteration changed the values by "
            f"{100.0 * change:.2g} % of their size. Each step's intervals assume that the other "
            "step's "
            "values are exact"
        )
    return best.noted((*notes, *notes_of(best)))


def _index(problem: Problem, label: str) -> int:
    return [u.label for u in problem.unknowns].index(label)


def restricted(problem: Problem, mine: Sequence[int], values: Array) -> Problem:
    """Return a problem with some unknowns free and the others fixed.

    Parameters
    ----------
    mine
        Indices of the unknowns that remain free.
    values
        Values of all unknowns: starting values of the free ones, constants for the fixed ones.
    """
    chosen = list(mine)
    begin = moved([problem.unknowns[k] for k in chosen], values[chosen])
    held = values.copy()

    def evaluate(some: Array) -> tuple[Array, Array]:
        whole = held.copy()
        whole[chosen] = some
        r, J = problem.evaluate(whole)
        return r, J[:, chosen]

    return Problem(begin, evaluate)


def _apart(problems: tuple[Problem, Problem], parts: Sequence[Estimate]) -> Estimate:
    """Return both parts as one estimate, each with its separate covariance."""
    first = len(parts[0].names)
    size = first + len(parts[1].names)
    covariance, spectrum = np.zeros((size, size)), np.zeros(size)
    for part, span in zip(parts, (slice(0, first), slice(first, size)), strict=True):
        covariance[span, span], spectrum[span] = part.covariance, part.singular_values
    return replace(
        parts[0],
        unknowns=_original(problems[0], parts),
        covariance=covariance,
        values=np.concatenate([part.values for part in parts]),
        singular_values=np.sort(spectrum)[::-1],
        residuals=np.concatenate([part.residuals for part in parts]),
        freedom=min(part.freedom for part in parts),
        colored=any(part.colored for part in parts),
        kept=_kept(problems[0], parts),
        notes=(),
    )


def _original(problem: Problem, parts: Sequence[Estimate]) -> tuple[Unknown, ...]:
    """Return the parts' unknowns with their starting values from before the first iteration."""
    return tuple(problem.unknowns[_index(problem, label)] for part in parts for label in part.names)


def _kept(problem: Problem, parts: Sequence[Estimate]) -> tuple[Kept, ...]:
    first = {u.label: u for u in problem.unknowns}
    already = [k for part in parts for k in part.kept]
    return tuple(replace(k, unknown=first[k.unknown.label]) for k in already)


def _combined(
    problems: tuple[Problem, Problem], parts: Sequence[Estimate], values: Array
) -> Estimate:
    """Return both parts as one estimate with its joint covariance."""
    labels = [label for part in parts for label in part.names]
    columns = [_index(problems[0], label) for label in labels]
    residuals, jacobians, instruments = [], [], []
    first = 0
    for problem, part in zip(problems, parts, strict=True):
        r, J = problem.evaluate(values)
        Z = np.zeros((r.size, len(columns)))
        mine = slice(first, first + len(part.names))
        # Each fit weighs its residuals by their own size, an estimate of the real noise.
        size = float(np.sqrt(r @ r / max(r.size - len(part.names), 1)))
        Z[:, mine] = J[:, columns[mine]] / size
        residuals.append(r / size)
        jacobians.append(J[:, columns] / size)
        instruments.append(Z)
        first += len(part.names)
    r, J, Z = np.concatenate(residuals), np.vstack(jacobians), np.vstack(instruments)
    unknowns = _original(problems[0], parts)
    scale = np.array([u.scale for u in unknowns])
    sure = uncertainty(J * scale, r, Z * scale)
    return Estimate(
        unknowns=unknowns,
        values=values[columns],
        covariance=sure.covariance * np.outer(scale, scale),
        singular_values=np.asarray(np.linalg.svd(J * scale, compute_uv=False), dtype=float),
        residuals=np.concatenate([part.residuals for part in parts]),
        freedom=sure.freedom,
        colored=sure.colored,
        kept=_kept(problems[0], parts),
    )


# --- The fit

_DECADE = 10.0  # tau_L and T_L begin one decade below T1
_FAR = 1e3  # maximum ratio of a time constant to its starting value
_UNITS = {"K": "Pa/A"}
_WEIGHED = 2  # fits: the starting model weights the noise in the first, its result in the second
_MOVES = 5.0  # minimum pressure change that a step must cause, relative to a block's noise


class _Whitening:
    r"""Whitening filter: makes residuals of block means independent, with unit variance.

    .. math::
        \Sigma = \sigma^2 I + \sigma_u^2 (H - H 1 w^T)(H - H 1 w^T)^T

    H is the response of the means to every sample of the input. w averages the samples before the
    step, whose mean is subtracted from the input. A model driven by a measured current also
    responds to the current's noise. That response is as slow as the brake's, so residuals correlate
    over seconds.

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L of the responding model; SI, shape (5,).
    blocks, block
        Number of means, and number of samples in each.
    rest
        Number of samples before the step whose mean is subtracted.
    sigma, sigma_u
        Noise of a mean of the output, and of a sample of the input.
    interval
        Sample time [s].
    """

    def __init__(
        self,
        values: Array,
        blocks: int,
        block: int,
        rest: int,
        sigma: float,
        sigma_u: float,
        interval: float,
    ) -> None:
        n = blocks * block
        h = _impulse(values, n, interval)
        means = np.convolve(h, np.ones(block) / block)[:n]
        # Row k: the mean over the block that ends with sample (k + 1) block - 1.
        last = (np.arange(blocks) + 1) * block - 1
        back = last[:, None] - np.arange(n)[None, :]
        H = np.where(back >= 0, means[np.clip(back, 0, n - 1)], 0.0)
        H[:, :rest] -= H.sum(axis=1)[:, None] / rest
        covariance = sigma_u**2 * (H @ H.T)
        covariance[np.diag_indices(blocks)] += sigma**2
        self._root = np.linalg.cholesky(covariance)

    def __call__(self, values: Array) -> Array:
        """Return whitened residuals or Jacobian, shape (blocks,) or (blocks, p)."""
        from scipy import linalg

        return np.asarray(linalg.solve_triangular(self._root, values, lower=True))


def _starts_of(par: MotorcycleParameters, p: float) -> dict[str, float]:
    """Return the paper's starting values: eq. (15), and a slow pair one decade below.

    ``p``: pressure [Pa].

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 5.
    """
    model = two_pole(par, p, travel_at(p, par))
    slow, fast = (1.0 / (2.0 * math.pi * f) for f in model.poles_hz)
    pair = _DECADE * slow
    return {"K": model.gain, "tau_L": pair, "T1": slow, "T2": fast, "T_L": pair}


def unknowns_of(region: Region, starts: dict[str, float]) -> tuple[Unknown, ...]:
    """Return the five unknowns of eq. (22), and the rest pressure before every step."""
    five = [
        Unknown(
            name,
            starts[name],
            starts[name] / _FAR,
            starts[name] * _FAR,
            starts[name],
            _UNITS.get(name, "s"),
            trial=region.name,
        )
        for name in NAMES
    ]
    rests = [
        Unknown(
            "p_rest",
            step.rest,
            scale=max(abs(step.rest), 1e4),
            unit="Pa",
            trial=step.label or "step",
        )
        for step in region.steps
    ]
    return (*five, *rests)


def _over_time(region: Region, unknowns: tuple[Unknown, ...], near: Array) -> Problem:
    """Return the fit to the step responses, with one residual per block of time.

    ``near``: K, tau_L, T1, T2, T_L of the model that weights the measured current's noise, shape
    (5,).
    """
    whitenings = [
        _Whitening(
            near,
            step.pressure.size,
            step.block,
            step.before,
            step.sigma,
            step.sigma_i,
            step.interval,
        )
        for step in region.steps
    ]

    def evaluate(values: Array) -> tuple[Array, Array]:
        residuals, jacobians = [], []
        for k, (step, white) in enumerate(zip(region.steps, whitenings, strict=True)):
            y, slopes = response(values[:5], step.u, step.interval, step.block)
            J = np.zeros((y.size, values.size))
            J[:, :5], J[:, 5 + k] = slopes, 1.0
            residuals.append(white(values[5 + k] + y - step.pressure))
            jacobians.append(white(J))
        return np.concatenate(residuals), np.vstack(jacobians)

    return Problem(unknowns, evaluate)


def over_frequency(region: Region, unknowns: tuple[Unknown, ...]) -> Problem:
    """Return the fit to magnitude (logarithm) and phase [rad] of the frequency response."""
    points = region.points

    def evaluate(values: Array) -> tuple[Array, Array]:
        G, slopes = log_response(values[:5], points.frequencies)
        e = G - points.log_gain
        turned = (e.imag + math.pi) % (2.0 * math.pi) - math.pi
        J = np.zeros((2 * e.size, values.size))
        J[0::2, :5], J[1::2, :5] = slopes.real, slopes.imag
        weight = np.repeat(1.0 / points.deviation, 2)
        return np.column_stack((e.real, turned)).ravel() * weight, J * weight[:, None]

    return Problem(unknowns, evaluate)


def fit(
    region: Region, par: MotorcycleParameters, *, joint: bool, turns: int, pair: bool = True
) -> Estimate:
    """Return K, tau_L, T1, T2, T_L of a region.

    Parameters
    ----------
    region
        Records of the region.
    par
        Parameters for the starting values (see ``_starts_of``).
    joint
        True: fit all unknowns to all data. False: fit K, tau_L and T_L to steps, and T1 and T2 to
        sines.
    turns
        Maximum number of iterations of the two-step fit; the paper uses one.
    pair
        True: with a slow pair, eq. (22). False: tau_L = T_L, eq. (21).

    Raises
    ------
    ParameterError
        When the records cannot determine the unknowns. The message describes an experiment that
        can.
    """
    _require(region, joint)
    starts = _starts_of(par, region.pressure)
    near = np.array(list(starts.values()))
    unknowns = unknowns_of(region, starts)
    for _ in range(_WEIGHED):
        best = _fitted(region, unknowns, near, turns=0 if joint else turns, pair=pair)
        near = np.array(list(five_of(best).values()))
    return best


def _fitted(
    region: Region, unknowns: tuple[Unknown, ...], near: Array, *, turns: int, pair: bool
) -> Estimate:
    """Return the estimate from alternating steps or, with 0 turns, from all data together."""
    time, frequency = _over_time(region, unknowns, near), over_frequency(region, unknowns)
    rests = range(len(NAMES), len(unknowns))
    by_steps = [0, *((1, 4) if pair else ()), *rests]
    if turns:
        return _in_turn((time, frequency), (by_steps, [2, 3]), turns)

    def evaluate(values: Array) -> tuple[Array, Array]:
        parts = [problem.evaluate(values) for problem in (time, frequency)]
        return np.concatenate([r for r, _ in parts]), np.vstack([J for _, J in parts])

    starts = np.array([u.start for u in unknowns])
    return estimate(restricted(Problem(unknowns, evaluate), sorted([*by_steps, 2, 3]), starts))


def five_of(fitted: Estimate) -> dict[str, float]:
    """Return K, tau_L, T1, T2 and T_L of an estimate, including those fixed at their start."""
    values = {u.name: float(v) for u, v in zip(fitted.unknowns, fitted.values, strict=True)}
    values |= {k.unknown.name: k.unknown.start for k in fitted.kept}
    if "T_L" not in values and "tau_L" not in values:  # eq. (21): any pair that cancels
        values["tau_L"] = values["T_L"] = 1.0
    return {name: values[name] for name in NAMES}


def _require(region: Region, joint: bool) -> None:
    where = f"{region.name} pressure"
    if not region.steps:
        raise ParameterError(
            f"the data contain no step response at {where}, so K, tau_L and T_L cannot be "
            "estimated. Apply a current demand step from rest at that pressure, and record 4 s or "
            "more",
            name=where,
        )
    for step in region.steps:
        change = float(np.ptp(step.pressure))
        if not change > _MOVES * step.sigma or float(np.ptp(step.u)) == 0.0:
            raise ParameterError(
                f"the pressure hardly responds to the step at {where}: it changes by "
                f"{change / 1e5:.2g} bar, with {step.sigma / 1e5:.2g} bar of noise. None of "
                f"{', '.join(NAMES)} can be estimated. Use a larger step, with dither",
                name=where,
                value=f"{change / 1e5:.2g} bar",
            )
    count = region.points.frequencies.size
    if not joint and count < 2:
        raise ParameterError(
            f"the data contain {count or 'no'} sine{'s' if count != 1 else ''} from {BAND[0]:g} to "
            f"{BAND[1]:g} Hz at {where}, so T1 and T2 cannot be estimated from the frequency "
            "response. Record current demand sines at two or more frequencies, or set "
            "fit = 'joint'",
            name=where,
            value=f"{count or 'no'} sine",
        )
