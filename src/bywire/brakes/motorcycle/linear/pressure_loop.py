"""The sampled pressure loop around a linear model of the braking system."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from bywire.analysis.crossings import Margin, margin
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.brakes.motorcycle.linear import control_laws
from bywire.brakes.motorcycle.linear.rational import Rational
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.typing import Array, Complex

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
        return self._pid("pressure_feedback", frequencies) * self._inner(frequencies, 2)

    def closed(self, frequencies: Array) -> Complex:
        """Return pressure over its set point, at frequencies [Hz]."""
        drive = self._pid("pressure_demand", frequencies)
        return drive * self._inner(frequencies, 1) / (1.0 + self.open(frequencies))

    def models(self) -> tuple[LinearModel, LinearModel]:
        """Return loop gain (cut at the measured pressure) and closed loop, one model each."""
        import control

        def block(model: LinearModel) -> Any:
            return control.ss(model.A, model.B, model.C, model.D, model.period)

        ecu, T = self.par.ecu, self.plant.period
        current = control.ss([], [], [], [[1.0, 0.0, 0.0]], T)
        inner = control.feedback(
            block(self.plant) * block(control_laws.current_control(ecu)), current
        )
        path = inner * block(control_laws.demand_filter(ecu))
        gain = path[2, 0] * block(control_laws.pressure_feedback(ecu, self.p))
        # The measured pressure goes back into the second input of the pressure control.
        ahead = path * block(control_laws.pressure_control(ecu, self.p))
        back = control.ss([], [], [], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], T)
        closed = control.feedback(ahead, back, sign=1)[1, 0]
        return _single(gain, "p_meas"), _single(closed, "p")

    def margin(self) -> Margin:
        """Return crossover and phase margin."""
        return margin(self.open, BAND)

    def _pid(self, name: str, frequencies: Array) -> Complex:
        law: LinearModel = getattr(control_laws, name)(self.par.ecu, self.p)
        return law.response(frequencies)[:, 0, 0]

    def _law(self, name: str, frequencies: Array) -> Complex:
        law: LinearModel = getattr(control_laws, name)(self.par.ecu)
        return law.response(frequencies)[:, 0, 0]

    def _inner(self, frequencies: Array, output: int) -> Complex:
        """Return the way from the current demand to an output of the plant."""
        plant = self.plant.response(frequencies)[:, :, 0]
        pi = self._law("current_control", frequencies)
        current = pi / (1.0 + pi * plant[:, 0])
        return self._law("demand_filter", frequencies) * current * plant[:, output]


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
