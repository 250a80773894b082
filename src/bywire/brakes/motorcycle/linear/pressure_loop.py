"""The ECU's control laws, its current loop and its pressure loop, as linear models.

Where the gains are scheduled, a law is that of the gains frozen at a pressure: small motion about
an equilibrium knows no other, because the schedule is bumpless.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from bywire.analysis.crossings import Margin, margin
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.brakes.motorcycle.linear.brake import Rational
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import EcuParameters, MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.control import current_pi, low_pass_2, pressure_pid
from bywire.core.signals import signals_of, zeros
from bywire.core.typing import Array, Complex

Rotor = Literal["locked", "free"]
Law = Callable[[Any, Any], tuple[Any, Any]]


def pressure_feedback(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p from a fall of the measured one [Pa] to the demand [A]."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        signals = pressure_pid.Input(p_ref=0.0 * u, p_meas=-u)
        state, out = pressure_pid.output(x, signals, ecu.T_s, gains)
        return state, out.i

    return _linear("pressure-feedback", law, pressure_pid.State, ecu.T_s, ("Pa", "A"))


def pressure_demand(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p [Pa] from the set point [Pa] to the current demand [A]."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        signals = pressure_pid.Input(p_ref=u, p_meas=0.0 * u)
        state, out = pressure_pid.output(x, signals, ecu.T_s, gains)
        return state, out.i

    return _linear("pressure-demand", law, pressure_pid.State, ecu.T_s, ("Pa", "A"))


def pressure_control(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p from set point and measured one [Pa] to the demand [A]."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        signals = pressure_pid.Input(p_ref=u[0], p_meas=u[1])
        state, out = pressure_pid.output(x, signals, ecu.T_s, gains)
        return state, out.i

    units, inputs = ("Pa", "A"), ("p_ref", "p_meas")
    return _linear("pressure-control", law, pressure_pid.State, ecu.T_s, units, inputs)


def current_control(ecu: EcuParameters) -> LinearModel:
    """Return the current PI from the current error [A] to the duty cycle."""

    def law(x: current_pi.State, u: Any) -> tuple[Any, Any]:
        signals = current_pi.Input(i_ref=u, i_meas=0.0 * u)
        state, out = current_pi.output(x, signals, ecu.T_s, ecu.current)
        return state, out.duty

    return _linear("current-control", law, current_pi.State, ecu.T_s, ("A", "1"))


def demand_filter(ecu: EcuParameters) -> LinearModel:
    """Return the low-pass between pressure and current controller."""

    def law(x: low_pass_2.State, u: Any) -> tuple[Any, Any]:
        state, out = low_pass_2.output(x, u, ecu.T_s, ecu.filter)
        return state, out.y

    return _linear("demand-filter", law, low_pass_2.State, ecu.T_s, ("A", "A"))


def current_loop(par: MotorcycleParameters, p: float, rotor: Rotor) -> LinearModel:
    """Return the loop from the set point ``i_set`` to the currents ``i`` and ``i_meas``.

    PI at the ECU's sample time, battery and bridge, winding, anti-alias filter; the converter's
    resolution is left out.

    Parameters
    ----------
    par
        Parameters; the drive mode does not matter.
    p
        Pressure of the operating point [Pa].
    rotor
        ``"locked"``: no back-EMF, as where friction holds the shaft. ``"free"``: the shaft moves
        against the brake, without dry friction.
    """
    driven = par.replace({"drive.mode": "current-direct", "adc.law": "ideal"})
    return closed_loop(
        MotorcycleBrake(),
        driven,
        state_at(p, driven),
        memory_at(p, driven),
        inputs=("i_set",),
        outputs=("i", "i_meas"),
        locked=("theta", "omega", "p_mc", "p_pd", "y_p") if rotor == "locked" else (),
    )


def _linear(
    name: str,
    law: Law,
    state_type: Any,
    period: float,
    units: tuple[str, str],
    inputs: tuple[str, ...] = ("in",),
) -> LinearModel:
    """Return a law's Jacobians at zero, inside all limits."""
    import casadi as ca

    signals = signals_of(state_type)
    x, u = ca.SX.sym("x", len(signals)), ca.SX.sym("u", len(inputs))
    renewed, out = law(state_type(*ca.vertsplit(x)), u)
    after = ca.vertcat(*renewed)
    parts = [ca.jacobian(a, b) for a in (after, out) for b in (x, u)]
    values = ca.Function("law", [x, u], parts)(list(zeros(state_type)), 0.0)
    A, B, C, D = (np.array(value, dtype=float) for value in values)
    return LinearModel(
        name,
        A,
        B,
        C,
        D,
        tuple(signals),
        inputs,
        ("out",),
        tuple(s.unit for s in signals.values()),
        units[:1] * len(inputs),
        units[1:],
        np.zeros(len(signals)),
        period,
    )


# --- The pressure loop around a linear model of the braking system

BAND = (0.02, 200.0)
"""frequencies over which margins are looked for [Hz]"""


@dataclass(frozen=True, eq=False)
class PressureLoop:
    """PID, low-pass, sampled current loop and anti-alias filters around a linear brake.

    The current loop is that of the locked rotor: a model from current to pressure has the
    rotor's motion in it. Converters are ideal, the dither is off.

    ``par``: parameters of ECU, motor, supply and filters; ``brake``: transfer function from motor
    current to pressure [Pa/A]; ``p``: pressure of the operating point [Pa].
    """

    par: MotorcycleParameters
    brake: Rational
    p: float = 25e5

    @cached_property
    def plant(self) -> LinearModel:
        """Sampled model from duty cycle to measured current, pressure and measured pressure."""
        mode = {"drive.mode": "current-direct", "adc.law": "ideal"}
        driven = self.par.replace(mode)
        motor = linearize(
            MotorcycleBrake(),
            driven,
            state_at(self.p, driven),
            memory_at(self.p, driven),
            inputs=("duty",),
            outputs=("i", "y_i"),
        ).reduced(("i", "y_i"), held=True)
        sensor = driven.current_sensor
        span = np.diag([1.0, sensor.i_high - sensor.i_low])
        motor = replace(motor, C=span @ motor.C, outputs=("i", "i_meas"), output_units=("A", "A"))
        return _cascade(motor, self.brake, driven.anti_alias.f_aa).sampled(driven.ecu.T_s)

    def open(self, frequencies: Array) -> Complex:
        """Return the open loop, cut at the measured pressure, at frequencies [Hz]."""
        return _gain(pressure_feedback(self.par.ecu, self.p), frequencies) * self._inner(
            frequencies, 2
        )

    def closed(self, frequencies: Array) -> Complex:
        """Return pressure over its set point, at frequencies [Hz]."""
        drive = _gain(pressure_demand(self.par.ecu, self.p), frequencies)
        return drive * self._inner(frequencies, 1) / (1.0 + self.open(frequencies))

    def models(self) -> tuple[LinearModel, LinearModel]:
        """Return loop gain (cut at the measured pressure) and closed loop, one model each."""
        import control

        def block(model: LinearModel) -> Any:
            return control.ss(model.A, model.B, model.C, model.D, model.period)

        ecu, T = self.par.ecu, self.plant.period
        current = control.ss([], [], [], [[1.0, 0.0, 0.0]], T)
        inner = control.feedback(block(self.plant) * block(current_control(ecu)), current)
        path = inner * block(demand_filter(ecu))
        gain = path[2, 0] * block(pressure_feedback(ecu, self.p))
        # The measured pressure goes back into the second input of the pressure control.
        ahead = path * block(pressure_control(ecu, self.p))
        back = control.ss([], [], [], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], T)
        closed = control.feedback(ahead, back, sign=1)[1, 0]
        return _single(gain, "p_meas"), _single(closed, "p")

    def margin(self) -> Margin:
        """Return crossover and phase margin."""
        return margin(self.open, BAND)

    def _inner(self, frequencies: Array, output: int) -> Complex:
        """Return the way from the current demand to an output of the plant."""
        plant = self.plant.response(frequencies)[:, :, 0]
        pi = _gain(current_control(self.par.ecu), frequencies)
        current = pi / (1.0 + pi * plant[:, 0])
        return _gain(demand_filter(self.par.ecu), frequencies) * current * plant[:, output]


def _gain(law: LinearModel, frequencies: Array) -> Complex:
    return law.response(frequencies)[:, 0, 0]


def cancelling_pi(loop: PressureLoop, T: float, crossover: float) -> PressureLoop:
    """Return the loop with a PI whose zero cancels a time constant T [s].

    ``loop``: the loop whose PID is replaced; ``T``: time constant [s]; ``crossover``: frequency
    [Hz] at which the gain shall be 1.
    """
    unit = loop.par.replace(
        {"ecu.pressure.k_p": 1e-5, "ecu.pressure.k_i": 1e-5 / T, "ecu.pressure.k_d": 0.0}
    )
    gain = float(np.abs(PressureLoop(unit, loop.brake, loop.p).open(np.array([crossover])))[0])
    k_p = 1e-5 / gain
    tuned = unit.replace({"ecu.pressure.k_p": k_p, "ecu.pressure.k_i": k_p / T})
    return PressureLoop(tuned, loop.brake, loop.p)


def _single(block: Any, output: str) -> LinearModel:
    """Return a block with one pressure in and one out as a plain model."""
    states = tuple(f"x{k}" for k in range(block.nstates))
    return LinearModel(
        "pressure-loop",
        block.A,
        block.B,
        block.C,
        block.D,
        states,
        ("p_ref",),
        (output,),
        tuple("1" for _ in states),
        ("Pa",),
        ("Pa",),
        np.zeros(len(states)),
        float(block.dt),
    )


def _companion(brake: Rational) -> tuple[Array, Array, Array]:
    """Return A, B, C of a strictly proper transfer function, its first state the fastest."""
    den = np.asarray(brake.den, dtype=float) / brake.den[0]
    n = den.size - 1
    num = np.asarray(brake.num, dtype=float) / brake.den[0]
    A = np.vstack([-den[1:], np.eye(n - 1, n)])
    return A, np.eye(n, 1), np.concatenate([np.zeros(n - num.size), num])[None]


def _cascade(motor: LinearModel, brake: Rational, f_aa: float) -> LinearModel:
    """Return motor, brake and the pressure channel's filter in a row, continuous.

    The motor's first state is the current that drives the brake.
    """
    G, g, c = _companion(brake)
    n, w = G.shape[0], 2.0 * np.pi * f_aa
    A = np.zeros((n + 3, n + 3))
    A[:2, :2] = motor.A
    A[2 : n + 2, :1], A[2 : n + 2, 2 : n + 2] = g, G
    A[n + 2, 2 : n + 2], A[n + 2, n + 2] = w * c[0], -w
    C = np.zeros((3, n + 3))
    C[0, :2], C[1, 2 : n + 2], C[2, n + 2] = motor.C[1], c[0], 1.0
    internal = tuple(f"g{k}" for k in range(n))
    return LinearModel(
        brake.name,
        A,
        np.vstack([motor.B, np.zeros((n + 1, 1))]),
        C,
        np.zeros((3, 1)),
        (*motor.states, *internal, "y_p"),
        motor.inputs,
        ("i_meas", "p", "p_meas"),
        (*motor.state_units, *("1" for _ in internal), "Pa"),
        motor.input_units,
        ("A", "Pa", "Pa"),
        np.zeros(n + 3),
    )
