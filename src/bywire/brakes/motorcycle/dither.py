"""Dither for the motorcycle brake: trials on the nonlinear model, comparison and choice."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bywire.analysis.loop import Point
from bywire.analysis.periodic import PeriodicModel, periodic_model, require_moving
from bywire.bench.experiment import as_run
from bywire.bench.kpis.hysteresis import Loop, loop_area
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.samples import smoothed
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.experiments import friction_ramp
from bywire.brakes.motorcycle.linear import current_loop, demand_filter
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.control import dither
from bywire.control.dither import breakaway_current
from bywire.core.errors import ParameterError, SolverError
from bywire.core.signals import zeros
from bywire.core.typing import Array, Complex
from bywire.data.labeled import labeled
from bywire.plant import seal_friction
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run
from bywire.synthesis.study import Cut, variable

if TYPE_CHECKING:
    import xarray as xr

Par = MotorcycleParameters

_LEAST = 4  # minimum number of samples per period, enough for a triangle


def admissible_frequencies(par: Par, low: float, high: float, count: int) -> list[float]:
    """Return frequencies [Hz] whose period is an even number of sample times.

    Both half-waves then have the same samples, and the motion repeats with the period.

    Parameters
    ----------
    low, high, count
        Range and number of frequencies, logarithmically spaced and then rounded. Duplicates count
        once.

    Raises
    ------
    ParameterError
        When no such frequency is in the range.
    """
    T = par.ecu.T_s
    halves = {max(round(0.5 / (f * T)), _LEAST // 2) for f in np.geomspace(low, high, count)}
    frequencies = sorted(0.5 / (n * T) for n in halves)
    inside = [f for f in frequencies if low * (1 - 1e-9) <= f <= high * (1 + 1e-9)]
    if not inside:
        raise ParameterError(
            f"no dither frequency from {low:g} to {high:g} Hz has a period equal to an even number "
            f"of sample times ({T * 1e3:g} ms each). Widen the range (f_min, f_max), or sample "
            "faster (ecu.T_s)",
            name="f_min",
            value=f"{low:g}",
        )
    return inside


def breakaway_torques(par: Par, p: float) -> tuple[float, float]:
    """Return the torques [N m] at which the shaft breaks away, apply and release, eq. (18)."""
    friction = seal_friction.output(seal_friction.Input(0.0, p), par.seal)
    return float(friction.T_p), float(friction.T_n)


def dead_band(par: Par, p: float) -> float:
    """Return the width of the current range [A] in which the piston may rest at a pressure [Pa]."""
    return sum(breakaway_torques(par, p)) / (_efficiency(par) * par.motor.K_e)


def attenuation(par: Par, frequencies: Array, p: float) -> Complex:
    """Return the ratio of motor current to dither current with a stuck shaft, shape (n,).

    The ratio includes the current loop, and the demand's low-pass filter if it follows the dither.
    A stuck shaft has neither back-EMF nor acceleration, so all of the current's torque acts against
    friction.
    """
    loop = current_loop(par, p, "locked").response(frequencies)[:, 0, 0]
    if par.ecu.filter.place == "before-dither":
        return np.asarray(loop)
    return np.asarray(loop * demand_filter(par.ecu).response(frequencies)[:, 0, 0])


def reach(par: Par, f: float, p: float) -> float:
    """Return the motor current's peak relative to the dither amplitude, with a stuck shaft.

    Every harmonic of the sampled waveform passes through the filter and the current loop. A square
    wave's fundamental alone exceeds its amplitude.

    ``f``: frequency [Hz] whose period is a whole number of sample times.
    """
    samples = waveform(par, f)
    n = samples.size
    lines = np.fft.rfft(samples) / n
    orders = np.arange(1, (n + 1) // 2)
    passed = lines[orders] * attenuation(par, orders / (n * par.ecu.T_s), p)
    angles = np.outer(2.0 * np.pi * np.linspace(0.0, 1.0, 64 * n, endpoint=False), orders)
    return float(np.max(2.0 * np.real(np.exp(1j * angles) @ passed)))


def waveform(par: Par, f: float) -> Array:
    """Return one period of the dither at the ECU's samples, with amplitude 1."""
    shape = par.ecu.dither.replace({"f_dit": f, "gain": 1.0})
    unit = par.ecu.est_par.replace({"T_pr": 1.0, "f_cfr_p": 0.0, "k_brk_p": 1.0, "K_e": 1.0})
    state, samples = dither.State(0.0), []
    for _ in range(round(1.0 / (f * par.ecu.T_s))):
        state, out = dither.output(state, 0.0, par.ecu.T_s, shape, unit)
        samples.append(float(out.i))
    return np.array(samples)


def needed_gain(par: Par, f: float, p: float) -> float:
    r"""Return the dither gain at which a stuck shaft just breaks away in both directions.

    .. math:: A_{dit} = \frac{T_{brk,p} + T_{brk,n}}{2 \eta_g K_e r(f)}

    with the reach r, because the mean current settles in the middle of the dead band. In contrast,
    the ECU's own eqs. (18) and (19) use only the apply direction and the ECU's estimate of the
    friction. They include neither efficiency nor attenuation.
    """
    amplitude = 0.5 * dead_band(par, p) / reach(par, f, p)
    return amplitude / float(dither.breakaway_current(p, par.ecu.est_par))


def _efficiency(par: Par) -> float:
    return par.gear.eta_g if par.gear.law == "paper" else 1.0


# --- Trials

FIGURES = {
    "stuck": ("1", "fraction of time stuck"),
    "band": ("1", "remaining dead band"),
    "ripple_sensor": ("Pa", "peak-to-peak ripple at the sensor"),
    "ripple_caliper": ("Pa", "peak-to-peak ripple at the caliper"),
    "current_rms": ("A", "rms motor current from dither"),
    "copper": ("W", "copper loss from dither"),
    "current_share": ("1", "peak current set point relative to its limit"),
    "duty_share": ("1", "peak duty cycle relative to its limit"),
}
"""unit and label of a trial's key figures"""

_SIGNALS = ("i", "i_ref", "duty", "p_mc", "p_pd", "t_stuck", "E_copper")
_STEP = 20e-6


@dataclass(frozen=True)
class Trial:
    """Settings of a trial.

    ``settle``: time [s] for the pressure loop to settle; ``window``: time [s] for measuring the
    figures, rounded down to whole periods of each dither; ``approach``: distance [Pa] from which
    the pressure loop approaches the pressure from below and from above.
    """

    settle: float = 4.0
    window: float = 1.0
    approach: float = 2e5


def tried(
    par: Par, p: float, gains: Sequence[float], frequencies: Sequence[float], trial: Trial
) -> Mapping[str, Array]:
    """Return every dither's figures at a pressure, with the pressure loop closed.

    The pressure controller approaches the pressure from below and from above. If dither overcomes
    friction, both approaches need the same mean current. The difference of the currents, relative
    to the friction's dead band, is the remaining hysteresis.

    Parameters
    ----------
    p
        Pressure [Pa], > ``trial.approach``.
    gains, frequencies
        Dither gains; frequencies [Hz] whose period is a whole number of sample times.

    Returns
    -------
    dict
        The variables of `FIGURES`, shape (gains, frequencies).

    Raises
    ------
    ParameterError
        When the brake cannot hold a pressure, or a value is out of range.
    SolverError
        When a trajectory diverges.
    """
    controlled = par.replace({"drive.mode": "pressure"})
    pairs = [(g, f) for g in gains for f in frequencies]
    both = [
        _measured(controlled, p, start, pairs, trial)
        for start in (p - trial.approach, p + trial.approach)
    ]
    apart = np.abs(both[1]["mean"] - both[0]["mean"]) / dead_band(controlled, p)
    worse = {name: np.fmax(both[0][name], both[1][name]) for name in FIGURES if name != "band"}
    shape = (len(gains), len(frequencies))
    return {name: value.reshape(shape) for name, value in {**worse, "band": apart}.items()}


def _measured(
    par: Par, p: float, start: float, pairs: Sequence[tuple[float, float]], trial: Trial
) -> dict[str, Array]:
    """Return all dithers' figures after an approach from one side, shape (cases,) each."""
    row = [float(value) for value in zeros(Stimulus)._replace(p_set=p)]
    T = par.ecu.T_s
    run = Run(
        MotorcycleBrake(),
        par,
        state_at(start, par),
        memory_at(start, par),
        lambda t: np.repeat([row], t.size, axis=0),
        trial.settle + trial.window,
        _STEP,
        T,
    )
    gains, frequencies = (np.array(values) for values in zip(*pairs, strict=True))
    ensemble = simulate_ensemble(
        run, {"ecu.dither.gain": gains, "ecu.dither.f_dit": frequencies}, _SIGNALS
    )
    figures = [
        _figures(par, ensemble.values[k], max(int(trial.window * f), 1), round(1.0 / (f * T)))
        for k, f in enumerate(frequencies)
    ]
    return {name: np.array([case[name] for case in figures]) for name in figures[0]}


def _figures(par: Par, values: Array, periods: int, samples: int) -> dict[str, float]:
    """Return the figures of a run's last periods, each with a number of samples."""
    count = periods * samples
    late = dict(zip(_SIGNALS, values[-count - 1 :].T, strict=True))
    duration = count * par.ecu.T_s
    whole = {name: value[:-1] for name, value in late.items()}
    mean = float(whole["i"].mean())
    copper = float(late["E_copper"][-1] - late["E_copper"][0]) / duration
    extra = max(copper - par.motor.R_m * mean**2, 0.0)
    return {
        "mean": mean,
        "stuck": float(late["t_stuck"][-1] - late["t_stuck"][0]) / duration,
        "ripple_sensor": _ripple(whole["p_mc"], samples),
        "ripple_caliper": _ripple(whole["p_pd"], samples),
        "current_rms": float(np.sqrt(extra / par.motor.R_m)),
        "copper": extra,
        "current_share": float(np.abs(whole["i_ref"]).max()) / par.ecu.pressure.i_max,
        "duty_share": float(np.abs(whole["duty"]).max()) / par.ecu.current.D_max,
    }


def _ripple(pressure: Array, samples: int) -> float:
    """Return the dither's ripple: the pressure's peak-to-peak value, as the median of all periods.

    If dither is too weak to free the piston, the controller's integral term does so occasionally.
    The median ignores these jumps.
    """
    return float(np.median(np.ptp(pressure.reshape(-1, samples), axis=1)))


def area_ratios(par: Par, designs: Sequence[tuple[float, float]]) -> list[float]:
    """Return each design's loop area (current versus pressure), relative to that without dither.

    Loops are averaged over one dither period. Most of the remaining area is delay rather than
    friction, and decreases with the ramp's slope.

    ``designs``: gain and frequency [Hz] of each dither.
    """
    options = friction_ramp.EXPERIMENT.defaults
    case = friction_ramp.cases(par, friction_ramp.Options.model_validate(options.model_dump()))[1]
    run = as_run(case, _STEP)
    every = [(0.0, designs[0][1]), *designs]
    changes = {
        "ecu.dither.gain": [gain for gain, _ in every],
        "ecu.dither.f_dit": [f for _, f in every],
    }
    ensemble = simulate_ensemble(run, changes, ("i", "p_mc"))
    areas = []
    for k, (_, f) in enumerate(every):
        i, p = (smoothed(ensemble.time, ensemble[name][k], 1.0 / f) for name in ("i", "p_mc"))
        areas.append(loop_area(Loop(ensemble.time, i, p)).value)
    return [area / areas[0] for area in areas[1:]]


# --- Comparison and choice

Figures = Mapping[str, Array]

OVERCOMES = ("stuck", "band")
"""figures that decrease with the amplitude: below their limits friction is treated as overcome"""
COSTS = ("ripple_caliper", "current_share", "duty_share")
"""figures that increase with the amplitude"""

NAMES = {
    "stuck": "fraction of time stuck",
    "band": "remaining dead band",
    "ripple_caliper": "ripple at the caliper",
    "current_share": "current limit",
    "duty_share": "duty cycle limit",
}
"""names of these figures in messages"""


@dataclass(frozen=True)
class Least:
    """The weakest dither at a frequency that overcomes friction.

    Parameters
    ----------
    gain
        Dither gain; NaN if no gain on the grid is sufficient.
    binding
        The figure of `OVERCOMES` that requires that gain.
    exceeded
        Figures of `COSTS` that exceed their limits at that gain.
    figures
        All figures at that gain, interpolated.
    """

    gain: float
    binding: str
    exceeded: tuple[str, ...]
    figures: Mapping[str, float]


def least(gains: Array, figures: Figures, limits: Mapping[str, float]) -> Least:
    """Return the weakest dither that overcomes friction at its gain and at all higher gains.

    ``gains``: shape (n,), ascending; ``figures``: name -> values at these gains, shape (n,);
    ``limits``: maximum of each figure in `OVERCOMES` and `COSTS`.
    """
    required = {name: crossing(gains, figures[name], limits[name]) for name in OVERCOMES}
    binding = max(OVERCOMES, key=lambda name: (math.isnan(required[name]), required[name]))
    gain = required[binding]
    if math.isnan(gain):
        return Least(gain, binding, (), dict.fromkeys(figures, math.nan))
    return _at_gain(gains, figures, limits, gain, binding)


def _at_gain(
    gains: Array, figures: Figures, limits: Mapping[str, float], gain: float, binding: str
) -> Least:
    """Return the figures at a gain within the grid, interpolated linearly."""
    at = {name: float(np.interp(gain, gains, values)) for name, values in figures.items()}
    exceeded = tuple(name for name in COSTS if at[name] > limits[name])
    return Least(gain, binding, exceeded, at)


def crossing(gains: Array, values: Array, limit: float) -> float:
    """Return the gain above which values stay within a limit, linear between points, or NaN.

    Examples
    --------
    >>> import numpy as np
    >>> round(crossing(np.array([1.0, 2.0, 3.0]), np.array([0.9, 0.2, 0.0]), 0.1), 6)
    2.5
    """
    above = np.flatnonzero(~(values <= limit))  # NaN is above every limit
    if not above.size:
        return float(gains[0])
    k = int(above[-1])
    if k == gains.size - 1 or math.isnan(values[k]):
        return math.nan if k == gains.size - 1 else float(gains[k + 1])
    share = (values[k] - limit) / (values[k] - values[k + 1])
    return float(gains[k] + share * (gains[k + 1] - gains[k]))


@dataclass(frozen=True)
class Candidate:
    """The lowest gain at one frequency that is sufficient at all pressures.

    ``gain``: NaN if no gain on the grid is sufficient; ``decisive``: index of the pressure that
    requires that gain; ``binding``: figure of `OVERCOMES` that requires that gain; ``price``:
    copper loss [W], mean of the pressures; ``ripple``: ripple at the caliper [Pa] at the worst
    pressure; ``exceeded``: figures of `COSTS` that exceed their limits at any pressure.
    """

    gain: float
    decisive: int
    binding: str
    price: float
    ripple: float
    exceeded: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """Reason to reject the candidate; empty if it is within all limits."""
        if math.isnan(self.gain):
            return f"{NAMES[self.binding]}: all gains are too low"
        return ", ".join(NAMES[name] for name in self.exceeded)


def candidates(
    gains: Array, figures: Sequence[Figures], limits: Mapping[str, float]
) -> list[Candidate]:
    """Return one candidate for every frequency.

    Parameters
    ----------
    figures
        For every pressure: name -> values, shape (gains, frequencies).
    """
    count = next(iter(figures[0].values())).shape[1]
    return [
        _candidate(gains, [_column(at_pressure, k) for at_pressure in figures], limits)
        for k in range(count)
    ]


def _column(figures: Figures, k: int) -> Figures:
    """Return one frequency's figures, shape (gains,) each."""
    return {name: values[:, k] for name, values in figures.items()}


def best_of(candidates: Sequence[Candidate]) -> int | None:
    """Return the index of the cheapest candidate within all limits, or None."""
    admissible = [k for k, candidate in enumerate(candidates) if not candidate.verdict]
    return min(admissible, key=lambda k: candidates[k].price, default=None)


def _candidate(gains: Array, columns: Sequence[Figures], limits: Mapping[str, float]) -> Candidate:
    each = [least(gains, column, limits) for column in columns]
    n = max(range(len(each)), key=lambda k: (math.isnan(each[k].gain), each[k].gain))
    gain, binding = each[n].gain, each[n].binding
    if math.isnan(gain):
        return Candidate(gain, n, binding, math.nan, math.nan, ())
    there = [_at_gain(gains, column, limits, gain, binding) for column in columns]
    return Candidate(
        gain,
        n,
        binding,
        price=float(np.mean([at_pressure.figures["copper"] for at_pressure in there])),
        ripple=max(at_pressure.figures["ripple_caliper"] for at_pressure in there),
        exceeded=tuple(sorted({name for at_pressure in there for name in at_pressure.exceeded})),
    )


# --- The map

Report = Callable[[float], None]


@dataclass(frozen=True)
class Grid:
    """The dithers to compare.

    ``pressures``, ``gains``, ``frequencies``: pressures [Pa], dither gains (ascending), frequencies
    [Hz]; ``trial``: settings of the trials.
    """

    pressures: Sequence[float]
    gains: Sequence[float]
    frequencies: Sequence[float]
    trial: Trial


def figures_of(par: Par, grid: Grid, report: Report) -> list[Mapping[str, Array]]:
    """Return every pressure's figures, shape (gains, frequencies) each."""
    figures = []
    for k, p in enumerate(grid.pressures):
        figures.append(tried(par, p, grid.gains, grid.frequencies, grid.trial))
        report((k + 1) / len(grid.pressures))
    return figures


def mapped(
    par: Par, grid: Grid, figures: Sequence[Mapping[str, Array]], limits: Mapping[str, float]
) -> xr.Dataset:
    """Return all figures, their worst values of all pressures, and the lowest sufficient gain.

    Returns
    -------
    xarray.Dataset
        Dimensions ``pressure``, ``gain``, ``frequency``: the variables of `FIGURES`; without
        pressure as ``worst_NAME``; ``least_gain`` and ``least_copper`` over pressure and
        frequency, NaN if no gain is sufficient; ``predicted_gain`` over pressure and frequency, and
        ``reach`` over frequency, from linear models alone.
    """
    dims = ("pressure", "gain", "frequency")
    gains = np.asarray(grid.gains)
    columns = {}
    for name, (unit, label) in FIGURES.items():
        values = np.stack([at_pressure[name] for at_pressure in figures])
        columns[name] = variable(values, dims, unit, label)
        columns[f"worst_{name}"] = variable(values.max(axis=0), dims[1:], unit, f"{label}, worst")
    enough = [
        [
            least(gains, {n: v[:, k] for n, v in at_pressure.items()}, limits)
            for k in range(len(grid.frequencies))
        ]
        for at_pressure in figures
    ]
    both = ("pressure", "frequency")
    predicted = [[needed_gain(par, f, p) for f in grid.frequencies] for p in grid.pressures]
    middle = grid.pressures[len(grid.pressures) // 2]
    columns |= {
        "least_gain": variable(
            [[c.gain for c in row] for row in enough],
            both,
            "1",
            "lowest gain that overcomes friction",
        ),
        "least_copper": variable(
            [[c.figures["copper"] for c in row] for row in enough],
            both,
            "W",
            "copper loss from dither at the lowest gain",
        ),
        "predicted_gain": variable(
            predicted, both, "1", "gain at which a stuck shaft breaks away, from linear models"
        ),
        "reach": variable(
            [reach(par, f, middle) for f in grid.frequencies],
            ("frequency",),
            "1",
            "ratio of motor current to dither, stuck shaft",
        ),
    }
    import xarray as xr  # slow to load

    return xr.Dataset(columns).assign_coords(
        pressure=variable(list(grid.pressures), ("pressure",), "Pa", "pressure"),
        gain=variable(gains, ("gain",), "1", "dither gain"),
        frequency=variable(list(grid.frequencies), ("frequency",), "Hz", "dither frequency"),
    )


def by_frequency(grid: Grid, each: list[Candidate]) -> Cut:
    """Return the lowest gain for all pressures, its cost, and the limits that it exceeds."""
    names = ("gain", "price", "ripple")
    units = {"price": "W", "ripple": "Pa"}
    words = {
        "decided by": [
            f"{NAMES[candidate.binding]} at {grid.pressures[candidate.decisive] / 1e5:g} bar"
            for candidate in each
        ],
        "beyond": [candidate.verdict or "nothing" for candidate in each],
    }
    numbers = {name: [getattr(candidate, name) for candidate in each] for name in names}
    table = labeled(
        {"frequency": (list(grid.frequencies), "Hz", "dither frequency")},
        {name: (column, units.get(name, "1"), name) for name, column in (numbers | words).items()},
    )
    return Cut("lowest gain for all pressures together", table, ("frequency", *names, *words))


def by_pressure(par: Par, data: xr.Dataset) -> Cut:
    """Return the weakest dither at every pressure, each at its cheapest frequency."""
    rows: dict[str, list[float]] = {}
    for k, p in enumerate(data["pressure"].values):
        copper = data["least_copper"].values[k]
        n = int(np.nanargmin(copper)) if np.isfinite(copper).any() else 0
        f, gain = float(data["frequency"].values[n]), float(data["least_gain"].values[k, n])
        amplitude = gain * float(breakaway_current(p, par.ecu.est_par))
        torque = amplitude * reach(par, f, p) * par.motor.K_e
        row = {
            "frequency": f,
            "gain": gain,
            "predicted": float(data["predicted_gain"].values[k, n]),
            "amplitude": amplitude,
            "torque": torque,
            "breakaway": breakaway_torques(par, p)[0],
            "copper": float(copper[n]),
            **{
                name: float(np.interp(gain, data["gain"].values, data[name].values[k, :, n]))
                for name in ("ripple_sensor", "ripple_caliper", "current_share")
            },
        }
        for name, value in row.items():
            rows.setdefault(name, []).append(value)
    units = {
        "frequency": "Hz",
        "amplitude": "A",
        "torque": "N*m",
        "breakaway": "N*m",
        "copper": "W",
        "ripple_sensor": "Pa",
        "ripple_caliper": "Pa",
    }
    table = labeled(
        {"pressure": (data["pressure"].values, "Pa", "pressure")},
        {name: (values, units.get(name, "1"), name) for name, values in rows.items()},
    )
    title = "weakest dither for each pressure: torque at the shaft, gain predicted by linear models"
    return Cut(title, table, ("pressure", *rows))


def law(par: Par, data: xr.Dataset, best: int, grid: Grid) -> list[Kpi]:
    """Return the friction that the ECU must assume so that a gain of 1 is just sufficient."""
    f = grid.frequencies[best]
    p, est = np.asarray(grid.pressures), par.ecu.est_par
    current = np.array([float(breakaway_current(pressure, est)) for pressure in p])
    needed = data["least_gain"].values[:, best] * current * est.K_e / est.k_brk_p
    kpis = [
        Kpi(
            "optimum_reach",
            reach(par, f, float(np.median(p))),
            "1",
            "Ratio of motor current to dither at the optimum's frequency, with a stuck shaft.",
        ),
        Kpi(
            "optimum_predicted_gain",
            float(data["predicted_gain"].values[:, best].max()),
            "1",
            "Gain at which the stuck shaft breaks away in both directions, from linear models.",
        ),
    ]
    if p.size > 1:
        slope, offset = np.polyfit(p, needed, 1)
        offset += float(np.max(needed - (offset + slope * p)))  # enough at every pressure
        text = "Friction that the ECU must assume so that a gain of 1 is just sufficient:"
        kpis += [
            Kpi("law_T_pr", offset, "N*m", f"{text} friction torque from the preload."),
            Kpi("law_f_cfr_p", slope, "N*m/Pa", f"{text} increase with pressure."),
        ]
    return kpis


# --- The plant under dither

_DEAD, _NEUTRAL = 1e-12, 1e-6  # limits of poles that decay in a period, and of integrators
_ROUNDS, _CLOSE = 12, 1e-4  # corrections of the current, and the relative error that ends them


@dataclass(frozen=True, eq=False)
class DitheredPlant:
    """The plant around its motion with dither: current loop closed, pressure loop open.

    ``i``: mean current demand [A]; ``model``: from ``i_set`` to ``p_mc``.
    """

    i: float
    model: PeriodicModel

    @property
    def gain(self) -> float:
        """Ratio of mean pressure change to current demand change [Pa/A]."""
        return self.model.steady_gain

    @property
    def slowest(self) -> float:
        """Slowest decay rate divided by 2 pi [Hz]: the plant's first pole."""
        size = np.abs(self.model.averaged.poles())
        moving = size[(size > _DEAD) & (size < 1.0 - _NEUTRAL)]
        return float(-np.log(moving.max()) / (2.0 * np.pi * self.model.run.duration))


def dithered_plant(par: Par, p: float, step: float | None = None) -> DitheredPlant:
    """Return the linear model from current demand to pressure, at a mean pressure with dither.

    Seal friction that is higher while applying than while releasing shifts the mean pressure. A
    Newton iteration with the model's gain finds the current that holds this pressure.

    Parameters
    ----------
    par
        Parameters; drive mode and converter do not matter.
    p
        Mean pressure [Pa], > 0.
    step
        Substep [s]; see `periodic.STEPS`.

    Raises
    ------
    SolverError
        When no motion is periodic, or none has this mean pressure. If the piston remains stuck with
        dither, pressure does not follow the current.
    """
    driven = par.replace({"drive.mode": "current", "adc.law": "ideal"})
    dither = driven.ecu.dither
    whole = () if dither.waveform == "off" else (dither.f_dit,)
    i = holding_current(p, driven)
    for _ in range(_ROUNDS):
        stimulus = zeros(Stimulus)._replace(i_set=i)
        state, memory = state_at(p, driven), memory_at(p, driven)
        start = Point(MotorcycleBrake(), driven, state, memory, stimulus)
        model = periodic_model(start, ("i_set",), "p_mc", whole, step)
        require_moving(model)
        gain = model.steady_gain  # zero or negative: this orbit is not attracting
        if not gain > 0.0:
            break
        if abs(model.mean - p) <= _CLOSE * p:
            return DitheredPlant(i, model)
        i += (p - model.mean) / gain
    raise SolverError(
        f"no current demand near {i:.4g} A holds a mean pressure of {p / 1e5:g} bar with "
        "dither, because the piston sticks. Increase ecu.dither.gain",
        name="ecu.dither.gain",
        value=f"{i:.4g} A",
    )
