r"""Figures of gains on the nonlinear bench: sines by amplitude, and the brake's step.

Many sets of gains run in parallel, in the lanes of one ensemble. A set is measured in stages, and
dropped as soon as it cannot be the best.

Controller and sensor are linear between their limits. The closed loop G is measured with a sine of
one amplitude. The rest of the loop P (actuator, friction, dither) follows from the loop's laws C_r
(set point) and C_y (output, including the sensor):

.. math:: G = \frac{C_r P}{1 + C_y P}, \quad L = C_y P = \frac{C_y G}{C_r - C_y G}

P is the describing function at this amplitude of the set point. The margin therefore applies to
small and medium motion and does not prove stability for large motion. Scheduled gains have their
values at the operating point, which within a blend is exact only for small sines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np

from bywire.analysis.crossings import Margin, fall, measured_margin
from bywire.analysis.linear.corners import taking
from bywire.analysis.loop import Loop
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep, common_interval, complex_values, nyquist
from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.bench.kpis.families import evaluate
from bywire.bench.recording import Rows
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run

if TYPE_CHECKING:
    import xarray as xr

_POINTS = 12
_BELOW, _ABOVE = 4.0, 3.0  # range of frequencies, relative to the target
_LEAST = 3  # periods in a window
_WINDOWS = 12  # maximum per response, since friction and converter may prevent exact repetition
_ROUGH_WINDOWS, _ROUGH = 8, 5e-3


@dataclass(frozen=True)
class Small:
    """Figures of the closed loop's response to sines of one amplitude.

    Parameters
    ----------
    amplitude
        Amplitude of the sine, in the input's SI unit.
    bandwidth
        Frequency at which the gain has fallen to -3 dB [Hz]; the highest measured frequency if the
        gain stays above; 0 if the gain is below, or the mechanism sticks, from the lowest one on.
    least
        Minimum gain up to the target; 0 for a stuck mechanism.
    phase_margin, crossover
        Margin and crossover of the describing function [degree, Hz] (see
        `crossings.measured_margin`); NaN if the laws are unknown.
    peak
        Maximum gain.
    settled
        Whether every response became periodic.
    """

    amplitude: float
    bandwidth: float
    least: float
    phase_margin: float
    crossover: float
    peak: float
    settled: bool


class Sines:
    """Responses of several sets of gains to sines, measured on demand.

    Parameters
    ----------
    loop, par, value, amplitudes, gains, target, rough
        See `bench_figures.wanted_figures`.

    Attributes
    ----------
    near, others
        Indices of the frequencies next to the target, and of the others.
    """

    def __init__(
        self,
        loop: Loop,
        par: ParameterSet,
        value: float,
        amplitudes: Sequence[float],
        gains: Mapping[str, Sequence[float]],
        target: float,
        *,
        rough: bool,
    ) -> None:
        point = loop.point(par.replace(loop.sustained), value)
        self._run, self._whole = point.run(), loop.whole(point.par)
        self._loop, self._par, self._value, self._target = loop, par, value, target
        self._amplitudes, self._gains, self._rough = tuple(amplitudes), gains, rough
        self._f: Array = np.array(_frequencies(self._run, self._whole, target))
        first = min(int(np.searchsorted(self._f, target)), self._f.size - 1)
        self.near = sorted({max(first - 1, 0), first})
        self.others = [k for k in range(self._f.size) if k not in self.near]
        sets = len(next(iter(gains.values())))
        shape = (sets, len(self._amplitudes), self._f.size)
        self._closed: Complex = np.full(shape, np.nan, dtype=np.complex128)
        self._size, self._settled = np.zeros(shape), np.zeros(shape, dtype=bool)

    def measure(self, sets: Sequence[int], which: Sequence[int]) -> None:
        """Measure some sets of gains at some frequencies, both by index."""
        if not sets or not which:
            return
        chosen = {name: [float(values[k]) for k in sets] for name, values in self._gains.items()}
        sweep = Sweep(
            self._loop.inputs,
            self._loop.output,
            self._f[list(which)].tolist(),
            self._amplitudes,
            chosen,
            flags=(),
            whole=self._whole,
            least=_LEAST,
            tolerance=_ROUGH if self._rough else 1e-3,
            most=_ROUGH_WINDOWS if self._rough else _WINDOWS,
        )
        responses = frequency_response(self._run, sweep)
        at = np.ix_(sets, range(len(self._amplitudes)), which)
        self._f[list(which)] = responses["frequency"].values
        self._closed[at] = complex_values(responses)
        self._size[at] = np.nan_to_num(responses["gain"].values)  # a stuck mechanism has no gain
        self._settled[at] = responses["settled"].values > 0

    def first_look(self, k: int) -> tuple[Small, ...]:
        """Return the figures of a set from the frequencies next to the target: the gain there."""
        f, unknown = self._f[self.near], (math.nan,) * 3
        return tuple(
            Small(
                size,
                math.nan,
                float(np.interp(self._target, f, gain)),
                *unknown,
                bool(settled.all()),
            )
            for size, gain, settled in zip(
                self._amplitudes,
                self._size[k][:, self.near],
                self._settled[k][:, self.near],
                strict=True,
            )
        )

    def figures(self, k: int) -> tuple[Small, ...]:
        """Return the figures of a set by amplitude, measured at all frequencies."""
        gains = {name: float(values[k]) for name, values in self._gains.items()}
        laws = laws_of(self._loop, self._par.replace(gains), self._value, self._f)
        return tuple(self._small(laws, k, j) for j in range(len(self._amplitudes)))

    def _small(self, laws: tuple[Complex, Complex] | None, k: int, j: int) -> Small:
        closed, f, size = self._closed[k, j], self._f, self._size[k, j]
        moves = np.isfinite(closed)
        margin = Margin(math.nan, math.nan)
        if laws is not None and moves.any():
            demand, feedback = laws
            gain = _behind(closed[moves], demand[moves], feedback[moves])
            margin = measured_margin(f[moves], gain)
        before = np.append(size[f < self._target], np.interp(self._target, f, size))
        return Small(
            amplitude=float(self._amplitudes[j]),
            bandwidth=min(fall(size, f), float(f[-1])),
            least=float(before.min()),
            phase_margin=margin.phase,
            crossover=margin.crossover,
            peak=float(size.max()),
            settled=bool(self._settled[k, j].all()),
        )


def _frequencies(run: Run, whole: Sequence[float], target: float) -> list[float]:
    """Return ascending frequencies with few periods in whole sample times and dither periods.

    Each period occurs at a different phase of the dither. With one period, friction would lock
    10 Hz to five periods of 50 Hz, and the result would depend on the initial phase.
    """
    common = common_interval(run, whole)
    limit = nyquist(run)
    wanted = np.geomspace(target / _BELOW, min(_ABOVE * target, 0.9 * limit), _POINTS)
    frequencies = set()
    for f in wanted:
        choices = [(n, max(round(n / f / common), 1)) for n in range(_LEAST, _LEAST + 3)]
        n, m = min(
            ((n, m) for n, m in choices if math.gcd(n, m) == 1),
            key=lambda candidate: abs(candidate[0] / (candidate[1] * common * f) - 1.0),
            default=choices[0],
        )
        frequencies.add(n / (m * common))
    return sorted(candidate for candidate in frequencies if candidate < limit)


def loop_gain(
    loop: Loop, par: ParameterSet, value: float, closed: Complex, frequencies: Array
) -> Complex | None:
    """Return the loop gain from a measured closed-loop response.

    Parameters
    ----------
    loop, par, value
        The loop, and the parameters and operating point of the measurement.
    closed, frequencies
        Response and frequencies [Hz], shape (n,).

    Returns
    -------
    numpy.ndarray or None
        Shape (n,); None for a loop with unknown laws.
    """
    laws = laws_of(loop, par, value, frequencies)
    return None if laws is None else _behind(closed, *laws)


def laws_of(
    loop: Loop, par: ParameterSet, value: float, frequencies: Array
) -> tuple[Complex, Complex] | None:
    """Return the controller's response to set point and measured value; None if unknown."""
    if loop.laws is None:
        return None
    with taking(loop.side):
        return loop.laws(par, value, frequencies)


def _behind(closed: Complex, demand: Complex, feedback: Complex) -> Complex:
    return np.asarray(feedback * closed / (demand - feedback * closed))


# --- Figures of the bench

STEP_FIGURES = ("overshoot", "settling_time", "steady_state_error")


@dataclass(frozen=True)
class BenchFigures:
    """Figures of one set of gains on the nonlinear bench, as far as they are measured.

    Parameters
    ----------
    small
        Figures by amplitude.
    step
        Overshoot [%], settling time [s] and steady-state error [% of the step] of the loop's
        experiment; empty without a step response. NaN if not defined.
    reasons
        Reasons why figures of the step are not defined, by name.
    """

    small: tuple[Small, ...]
    step: Mapping[str, float]
    reasons: Mapping[str, str] = field(default_factory=dict)


Worth = Callable[[int, BenchFigures], bool]
"""``worth(k, figures) -> bool``: whether to continue with set k, given its figures so far"""


def bench_figures(
    loop: Loop,
    par: ParameterSet,
    value: float,
    amplitudes: Sequence[float],
    gains: Mapping[str, Sequence[float]],
    bench: Bench | None,
    target: float,
) -> tuple[BenchFigures, ...]:
    """Return the figures of several sets of gains.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point, with friction, dither and limits; the sines use the
        loop's ``sustained`` parameters.
    amplitudes
        Amplitudes of the sines, SI.
    gains
        Dotted name -> its value in each set [SI].
    bench
        Experiment with the judged step, or None.
    target
        Center of the measured frequencies [Hz], which range from a quarter to three times of it.
    """
    everything = wanted_figures(
        loop, par, value, amplitudes, gains, bench, target, lambda k, known: True
    )
    return tuple(figures for figures in everything if figures is not None)


def wanted_figures(
    loop: Loop,
    par: ParameterSet,
    value: float,
    amplitudes: Sequence[float],
    gains: Mapping[str, Sequence[float]],
    bench: Bench | None,
    target: float,
    worth: Worth,
    *,
    rough: bool = False,
) -> tuple[BenchFigures | None, ...]:
    """Return the figures of several sets of gains, measured as long as they are promising.

    The cheap step comes first, then the sines next to the target, which determine only the minimum
    gain so far, then all others.

    Parameters
    ----------
    loop, par, value, amplitudes, gains, bench, target
        See `bench_figures`.
    worth
        Called before every stage except the first. Unknown figures are NaN or missing.
    rough
        Whether settling to 0.5 % is enough, as in a search.

    Returns
    -------
    tuple
        None for the dropped sets.
    """
    steps = _steps(bench, gains) if bench is not None else None
    sines = Sines(loop, par, value, amplitudes, gains, target, rough=rough)

    def known(k: int, small: tuple[Small, ...] = ()) -> BenchFigures:
        return BenchFigures(small, *(({},) if steps is None else steps[k]))

    sets = len(next(iter(gains.values())))
    wanted = [k for k in range(sets) if worth(k, known(k))]
    sines.measure(wanted, sines.near)
    wanted = [k for k in wanted if worth(k, known(k, sines.first_look(k)))]
    sines.measure(wanted, sines.others)
    figures = {k: known(k, sines.figures(k)) for k in wanted}
    return tuple(figures.get(k) for k in range(sets))


def has_step(bench: Bench) -> bool:
    """Return whether an experiment has a single run, with a judged step."""
    return bench.definition.step is not None and len(bench.cases()) == 1


def _steps(
    bench: Bench, gains: Mapping[str, Sequence[float]]
) -> list[tuple[dict[str, float], dict[str, str]]] | None:
    """Return the step's figures for every set of gains, and the reasons for undefined ones."""
    definition = bench.definition
    if definition.step is None or not has_step(bench):
        return None
    (case,) = bench.cases()
    setting = definition.step(bench.chosen_options)
    run = as_run(case, bench.step, seed=(bench.seed, 0))
    kept = {name: np.asarray(values, dtype=float) for name, values in gains.items()}
    ensemble = simulate_ensemble(run, kept, [setting.signal])
    unit = signals_of(case.model.Output)[setting.signal].unit
    height = abs((setting.end or 0.0) - (setting.start or 0.0))
    time = ensemble.time - case.settle
    rows = []
    for values in ensemble[setting.signal]:
        rows_of_set = Rows(time, {setting.signal: values}, {setting.signal: {"units": unit}})
        kpis = evaluate("step_response", cast("xr.Dataset", rows_of_set), setting)
        row = {name: kpis[name].value for name in STEP_FIGURES}
        row["steady_state_error"] *= 100.0 / height if height else math.nan
        missing = [name for name in STEP_FIGURES if math.isnan(row[name])]
        rows.append((row, {n: kpis[n].note or "the step has no height" for n in missing}))
    return rows
