"""What a wanted pressure asks of the motorcycle brake's motor: inverse dynamics, closed form.

The pressure is given as a function of time; flow, travel, torque, current and voltage follow from
the equations of the plant without any simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.typing import Array
from bywire.plant import ball_screw_gear, brake_fluid, caliper, master_cylinder, pipeline
from bywire.plant import seal_friction as seal

Par = MotorcycleParameters

_POINTS = 721
_DOUBLE_POLE = math.sqrt(math.sqrt(2.0) - 1.0)  # -3 dB frequency of 1/(1+s)^2, rad/s


@dataclass(frozen=True)
class Course:
    """A wanted pressure p_mc, its derivatives, and the caliper pressure, shape (n,) each.

    ``t``: times [s]; ``p``, ``rate``, ``bend``: pressure [Pa] and its first and second derivatives;
    ``p_pd``: caliper pressure [Pa]; ``middle``: pressure [Pa] at which the compliances are taken.
    """

    t: Array
    p: Array
    rate: Array
    bend: Array
    p_pd: Array
    middle: float


@dataclass(frozen=True)
class Motion:
    """What the motor does, shape (n,) each, SI.

    ``omega``: speed [rad/s]; ``torque``: electromagnetic torque [N m]; ``inertia``: part of it that
    accelerates rotor and piston [N m]; ``current``, ``voltage``: current [A] and voltage of the
    winding [V], its inductance left out; ``available``: voltage that the bridge can give at this
    current [V].
    """

    omega: Array
    torque: Array
    inertia: Array
    current: Array
    voltage: Array
    available: Array

    @property
    def mechanical(self) -> Array:
        """Mechanical power [W]."""
        return self.torque * self.omega

    @property
    def electrical(self) -> Array:
        """Electrical power at the motor [W]: copper loss and mechanical power."""
        return self.voltage * self.current


def sine(par: Par, top: float, amplitude: float, f: float) -> Course:
    """Return one period of a sine of a frequency [Hz] whose crest is at a pressure ``top`` [Pa]."""
    middle, w = top - amplitude, 2.0 * math.pi * f
    t = np.linspace(0.0, 1.0 / f, _POINTS)
    lagging = amplitude * np.exp(1j * w * t) / (1.0 + 1j * w * _lag(par, middle))
    return Course(
        t=t,
        p=middle + amplitude * np.sin(w * t),
        rate=amplitude * w * np.cos(w * t),
        bend=-amplitude * w * w * np.sin(w * t),
        p_pd=middle + lagging.imag,
        middle=middle,
    )


def step(par: Par, p_from: float, p_to: float, bandwidth: float) -> Course:
    r"""Return a step between two pressures [Pa] as a double pole of a bandwidth [Hz] answers it.

    .. math:: p = p_0 + \Delta (1 - (1 + w t) e^{-w t}), \quad w = 2 \pi f / \sqrt{\sqrt 2 - 1}
    """
    middle, height = 0.5 * (p_from + p_to), p_to - p_from
    w, a = 2.0 * math.pi * bandwidth / _DOUBLE_POLE, 1.0 / _lag(par, middle)
    # Of a triple pole the closed form divides by zero: the lag and the double pole stay apart.
    w = w if abs(w / a - 1.0) > 1e-6 else w * (1.0 + 1e-6)
    t = np.linspace(0.0, 10.0 / w, _POINTS)
    slow, fast = np.exp(-w * t), np.exp(-a * t)
    A, C = -(w * w) / (w - a) ** 2, -w * a / (a - w)
    return Course(
        t=t,
        p=p_from + height * (1.0 - (1.0 + w * t) * slow),
        rate=height * w * w * t * slow,
        bend=height * w * w * (1.0 - w * t) * slow,
        p_pd=p_from + height * (1.0 + A * fast + (C * t - 1.0 - A) * slow),
        middle=middle,
    )


def motion(par: Par, course: Course) -> Motion:
    r"""Return what the motor does while the pressure follows its course.

    .. math::
        A_{mc} v = C_{mc} \dot p_{mc} + q, \quad q = (p_{mc} - p_{pd})/K_{lf}, \quad
        \eta_g T = k_g (A_{mc} p_{mc} + k_{damp} v) + T_{fr} + M' \dot\Omega

    with eta_g = 1 for gear law "directional", whose loss is in T_fr. The compliances are those at
    the middle of the course, the seals slide.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eqs. (1), (8), (9), (11), (12) and (16).
    """
    k_g, cylinder = par.gear.k_g, par.master_cylinder
    K_lf = pipeline.resistance(par.pipeline, par.fluid)
    C_mc = _chamber_compliance(par, course.middle)
    q_rate = (course.rate - _rate_of_caliper(par, course)) / K_lf
    v = (C_mc * course.rate + (course.p - course.p_pd) / K_lf) / cylinder.A_mc
    acceleration = (C_mc * course.bend + q_rate) / (cylinder.A_mc * k_g)
    omega = v / k_g
    force, rubbing = _load(par, course.p, v, omega)
    limits = ball_screw_gear.friction_bounds(rubbing.T_p, rubbing.T_n, force, par.gear)
    # Bounds are torques on the shaft; against its motion they add to what the motor must give.
    friction = np.where(omega > 0, -np.asarray(limits.low), -np.asarray(limits.high))
    friction = np.where(omega == 0, 0.0, friction)
    efficiency = par.gear.eta_g if par.gear.law == "paper" else 1.0
    inertia = ball_screw_gear.inertia(par.gear) * acceleration / efficiency
    torque = (k_g * force + friction) / efficiency + inertia
    current = torque / par.motor.K_e
    D = par.bridge.D_max
    return Motion(
        omega=omega,
        torque=torque,
        inertia=inertia,
        current=current,
        voltage=par.motor.R_m * current + par.motor.K_e * omega,
        available=D * (par.supply.V_bat - par.supply.R_bat * D * np.abs(current)),
    )


def breakaway_current(par: Par, p: float) -> float:
    """Return the current [A] that holds a pressure [Pa] and moves the piston on from there."""
    load, rest = _load(par, p, 0.0, 0.0)
    limit = ball_screw_gear.friction_bounds(rest.T_p, rest.T_n, load, par.gear)
    efficiency = par.gear.eta_g if par.gear.law == "paper" else 1.0
    return float(par.gear.k_g * load - limit.low) / (efficiency * par.motor.K_e)


def geared(par: Par, k_g: float) -> Par:
    """Return the brake with another gear ratio [m/rad], seals and pistons unchanged.

    The friction of the seals is stated as a torque at the shaft: as the force that it is, it grows
    with the ratio, its viscous part with the square. The pressure controller's gains, current per
    pressure, grow with the ratio too, so that the loop gain at low frequency stays.
    """
    r = k_g / par.gear.k_g
    powers = {
        "seal.T_pr": 1,
        "seal.f_cfr_p": 1,
        "seal.f_cfr_n": 1,
        "seal.c": 1,
        "seal.mu_T": 2,
        "ecu.est_par.T_pr": 1,
        "ecu.est_par.f_cfr_p": 1,
        "ecu.pressure.k_p": 1,
        "ecu.pressure.k_i": 1,
        "ecu.pressure.k_d": 1,
    }
    values = par.flat()
    return par.replace(
        {name: values[name] * r**n for name, n in powers.items()} | {"gear.k_g": k_g}
    )


def _load(par: Par, p: Any, v: Any, omega: Any) -> tuple[Any, seal.Output]:
    """Return the force on the piston and the friction of the seals, of numbers or of arrays."""
    at = master_cylinder.Input(0.0, v, 0.0)
    force = master_cylinder.output(master_cylinder.State(p), at, par.master_cylinder).force
    return force, seal.output(seal.Input(omega, p), par.seal)


def _lag(par: Par, p: float) -> float:
    """Return the time constant of pipeline and caliper [s]."""
    C_pd = caliper.mass(caliper.State(p), par.caliper, par.fluid)
    return C_pd * pipeline.resistance(par.pipeline, par.fluid)


def _rate_of_caliper(par: Par, course: Course) -> Array:
    return (course.p - course.p_pd) / _lag(par, course.middle)


def _chamber_compliance(par: Par, p: float) -> float:
    at = master_cylinder.Input(x=travel_at(p, par), v=0.0, q=0.0)
    volume = master_cylinder.volume(at, par.master_cylinder)
    return brake_fluid.compliance(brake_fluid.Chamber(V=volume, p=p), par.fluid)
