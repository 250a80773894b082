"""What of a dither reaches the shaft, and what it must be to break the piston away."""

from __future__ import annotations

import numpy as np

from bywire.brakes.motorcycle.linear.control_laws import current_loop, demand_filter
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control import dither
from bywire.core.errors import ParameterError
from bywire.core.typing import Array, Complex
from bywire.plant import seal_friction

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
