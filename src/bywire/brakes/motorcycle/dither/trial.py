"""Dithers tried on the nonlinear brake: what reaches the shaft, what friction is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.bench.experiment import as_run
from bywire.bench.kpis.hysteresis import Loop, loop_area
from bywire.bench.kpis.samples import smoothed
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.experiments import friction_ramp
from bywire.brakes.motorcycle.linear.pressure_loop import current_loop, demand_filter
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.control import dither
from bywire.core.errors import ParameterError
from bywire.core.signals import zeros
from bywire.core.typing import Array, Complex
from bywire.plant import seal_friction
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.run import Run

Par = MotorcycleParameters

_LEAST = 4  # samples in a period: with fewer, a triangle is none


def admissible_frequencies(par: Par, low: float, high: float, count: int) -> list[float]:
    """Return frequencies [Hz] whose period is an even number of sample times.

    Both half-waves then have the same samples, and the motion repeats with the period.

    Parameters
    ----------
    low, high, count
        About where and how many, evenly in their logarithm; those that fall together count once.

    Raises
    ------
    ParameterError
        When there is none in the range.
    """
    T = par.ecu.T_s
    wanted = np.geomspace(low, high, count)
    halves = {max(round(0.5 / (f * T)), _LEAST // 2) for f in wanted}
    known = sorted(0.5 / (n * T) for n in halves)
    inside = [f for f in known if low * (1 - 1e-9) <= f <= high * (1 + 1e-9)]
    if not inside:
        raise ParameterError(
            f"no dither of {low:g} to {high:g} Hz has a period of an even number of sample times "
            f"of {T * 1e3:g} ms: widen the range (f_min, f_max), or sample faster (ecu.T_s)"
        )
    return inside


def breakaway_torques(par: Par, p: float) -> tuple[float, float]:
    """Return the torques [N m] at which the shaft breaks away, apply and release, eq. (18)."""
    friction = seal_friction.output(seal_friction.Input(0.0, p), par.seal)
    return float(friction.T_p), float(friction.T_n)


def dead_band(par: Par, p: float) -> float:
    """Return the range of currents [A] at which the piston may rest at a pressure [Pa]."""
    return sum(breakaway_torques(par, p)) / (_efficiency(par) * par.motor.K_e)


def attenuation(par: Par, frequencies: Array, p: float) -> Complex:
    """Return motor current over dither current at a stuck shaft, shape (n,).

    Current loop, and the demand's low-pass where it comes after the dither. A shaft that sticks
    has neither back-EMF nor inertia: all of the current's torque stands against the friction.
    """
    loop = current_loop(par, p, "locked").response(frequencies)[:, 0, 0]
    if par.ecu.filter.place == "before-dither":
        return np.asarray(loop)
    return np.asarray(loop * demand_filter(par.ecu).response(frequencies)[:, 0, 0])


def reach(par: Par, f: float, p: float) -> float:
    """Return the motor current's largest value over the dither's amplitude, at a stuck shaft.

    Every harmonic of the sampled waveform passes filter and current loop; a square's fundamental
    alone exceeds its amplitude.

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
    """Return one period of the dither at the ECU's samples, amplitude 1."""
    shape = par.ecu.dither.replace({"f_dit": f, "gain": 1.0})
    unit = par.ecu.est_par.replace({"T_pr": 1.0, "f_cfr_p": 0.0, "k_brk_p": 1.0, "K_e": 1.0})
    state, samples = dither.State(0.0), []
    for _ in range(round(1.0 / (f * par.ecu.T_s))):
        state, out = dither.output(state, 0.0, par.ecu.T_s, shape, unit)
        samples.append(float(out.i))
    return np.array(samples)


def needed_gain(par: Par, f: float, p: float) -> float:
    r"""Return the gain of the dither's law at which a stuck shaft just breaks away both ways.

    .. math:: A_{dit} = \frac{T_{brk,p} + T_{brk,n}}{2 \eta_g K_e r(f)}

    with the reach r: the mean current settles in the middle of the dead band. Against the ECU's
    own eqs. (18) and (19), which take the apply direction alone, neither efficiency nor
    attenuation, and what the ECU believes of the friction.
    """
    amplitude = 0.5 * dead_band(par, p) / reach(par, f, p)
    return amplitude / float(dither.breakaway_current(p, par.ecu.est_par))


def _efficiency(par: Par) -> float:
    return par.gear.eta_g if par.gear.law == "paper" else 1.0


# --- Trials

FIGURES = {
    "stuck": ("1", "share of the time stuck"),
    "band": ("1", "dead band left"),
    "ripple_sensor": ("Pa", "ripple at the sensor, p-p"),
    "ripple_caliper": ("Pa", "ripple at the caliper, p-p"),
    "current_rms": ("A", "dither's motor current, rms"),
    "copper": ("W", "dither's copper power"),
    "current_share": ("1", "peak of the current set point over the limit"),
    "duty_share": ("1", "peak of the duty cycle over its limit"),
}
"""unit and label of what a trial gives"""

_SIGNALS = ("i", "i_ref", "duty", "p_mc", "p_pd", "t_stuck", "E_copper")
_STEP = 20e-6


@dataclass(frozen=True)
class Trial:
    """How dithers are tried.

    ``settle``, ``window``: time [s] until the pressure loop has settled, and over which figures are
    taken, rounded down to whole periods of each dither; ``approach``: distance [Pa] from which the
    pressure is approached, from below and from above.
    """

    settle: float = 4.0
    window: float = 1.0
    approach: float = 2e5


def tried(
    par: Par, p: float, gains: Sequence[float], frequencies: Sequence[float], trial: Trial
) -> Mapping[str, Array]:
    """Return the figures of every dither at a pressure, pressure loop closed.

    The pressure controller takes the brake to the pressure from below, and from above. Where
    dither has overcome the friction, the mean current that holds the pressure is the same; what is
    left between the two, over the friction's dead band, is the hysteresis left.

    Parameters
    ----------
    p
        Pressure [Pa], > ``trial.approach``.
    gains, frequencies
        Of the dither's law; frequencies [Hz] with whole sample times in a period.

    Returns
    -------
    dict
        The variables of `FIGURES`, shape (gains, frequencies).

    Raises
    ------
    ParameterError
        When a pressure cannot be held, or a value is out of range.
    SolverError
        When a trajectory leaves the numbers.
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
    """Return the figures of all dithers after an approach from one side, shape (cases,) each."""
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
    """Return the figures of the last periods of a run, each of so many samples."""
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
    """Return the dither's ripple: what a pressure spans within a period, the median of all.

    Where dither is too weak to free the piston, the controller's integral part does it now and
    then; that jump is no ripple.
    """
    return float(np.median(np.ptp(pressure.reshape(-1, samples), axis=1)))


def area_ratios(par: Par, designs: Sequence[tuple[float, float]]) -> list[float]:
    """Return the area of each design's loop of current over pressure, over that without dither.

    Loops are averaged over one dither period. Most of what is left is delay rather than friction,
    and shrinks with the ramp's slope.

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
