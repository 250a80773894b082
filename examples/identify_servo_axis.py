"""Identify your own servo axis: parameters from measured angle and motor voltage.

The axis has an inertia, dry and viscous friction that differ by direction, and a drive offset. A
simulation in closed loop replaces the bench. To identify your own measurement, specify its file:
`identify_servo_axis.py axis.csv`.
"""

import sys
from typing import Annotated, NamedTuple

import numpy as np
import xarray as xr

import bywire
from bywire.authoring import (
    Angle,
    Duration,
    ParameterError,
    ParameterSet,
    Signal,
    Speed,
    Task,
    Unit,
    moved_run,
    zeros,
)
from bywire.core import ops
from bywire.identification import (
    Driven,
    Equation,
    differentiated,
    estimate,
    initial_states,
    inverse_dynamics,
    output_error,
    parameters_of,
    trial,
)

Volt = Annotated[float, Unit("V")]


class Axis(ParameterSet):
    """Parameters in volts at the motor, which are torques divided by the torque per volt."""

    J: Annotated[float, Unit("V*s**2/rad", 0.01)]
    d_p: Annotated[float, Unit("V*s/rad", 0.05)]
    d_n: Annotated[float, Unit("V*s/rad", 0.05)]
    T_p: Volt
    T_n: Volt
    offset: Volt
    T_s: Duration


class State(NamedTuple):
    theta: Angle
    omega: Speed


class Voltage(NamedTuple):
    v: Annotated[float, Signal("V", "motor voltage")]


class ServoAxis(Driven):
    """The equation of motion, J d(omega)/dt = v - offset - d omega -+ T."""

    name, State, Input = "axis", State, Voltage
    frictions = ("omega",)

    def mass(self, xe, par):
        return State(1.0, par.J)

    def balance(self, x, xe, m, par, contact):
        d = ops.where(x.omega > 0.0, par.d_p, par.d_n)
        return State(x.omega, m.v - par.offset - d * x.omega)

    def bounds(self, x, xe, m, par, contact):
        return ((-par.T_p, par.T_n),)


TRUTH = Axis(J=0.02, d_p=0.05, d_n=0.07, T_p=0.6, T_n=0.4, offset=0.1, T_s=1e-3)
# Motion determines T_p + offset and T_n - offset, but not all three. bywire reports this if you
# request all three. The drive offset is known from the data sheet.
NAMES = ("J", "d_p", "d_n", "T_p", "T_n")
NOISE = 1e-4
"""encoder noise [rad]; confidence intervals come from the residuals, not from this value"""


class ClosedLoop(ServoAxis):
    """The bench, where the angle follows a target."""

    def tasks(self, par):
        def tick(x, m, u, par):
            return Voltage(ops.clip(40.0 * (u.v - x.theta) - 1.0 * x.omega, -12.0, 12.0))

        return (Task("control", par.T_s, tick),)

    class Output(NamedTuple):
        theta: Angle
        v: Annotated[float, Signal("V", "motor voltage")]

    def output(self, x, m, par, contact, reaction, flow):
        return self.Output(x.theta, m.v)


def measured(seed=1, noise=NOISE):
    """Return 10 s of the axis in closed loop, with encoder noise."""
    f = np.array([[0.5], [0.9], [1.7]])
    target = lambda t: (np.array([2.0, 1.0, 0.5]) @ np.sin(2 * np.pi * f * t))[:, None]  # noqa: E731
    run = bywire.Run(ClosedLoop(), TRUTH, zeros(State), zeros(Voltage), target, 10.0)
    computed = bywire.simulate(run)
    theta = computed["theta"] + np.random.default_rng(seed).normal(0.0, noise, computed.time.size)
    return xr.Dataset(
        {"theta": ("time", theta), "v": ("time", computed["v"])}, {"time": computed.time}
    )


def filtered(data):
    """Return the motion with speed and acceleration, all with the same low-pass filter."""
    return differentiated(data, "theta", ("omega", "alpha"), cutoff=60.0, held=["v"])


def identified(data):
    """Return the parameters from inverse dynamics, from output error, and with instruments.

    Inverse dynamics works from any starting values. But angle noise, differentiated twice, looks
    like acceleration, so J is too small by more than its confidence interval. Output error does not
    have this bias. Inverse dynamics with the fitted model's noise-free motion as instruments does
    not have it either.
    """
    rough = Axis(J=0.01, d_p=0, d_n=0, T_p=1, T_n=1, offset=0.1, T_s=1e-3)
    equation = Equation(ServoAxis(), "omega", "alpha", slowest=1.0, unit="V")
    problem = equation, rough, parameters_of(rough, NAMES), filtered(data)
    first = inverse_dynamics(*problem, bandwidth=30.0)
    if "J" in first.names and first["J"] < 0.0:
        raise ParameterError(
            f"theta and v have opposite signs (J = {first['J']:.2g} V s^2/rad). Negate one of them"
        )

    known = rough.replace(first.parameters())
    bench = trial(ServoAxis(), known, data, inputs={"v": "v"}, outputs={"theta": NOISE})
    unknowns = parameters_of(known, NAMES) + initial_states(bench, ["theta"])
    second = estimate(output_error([bench], unknowns))

    fitted = dict(zip(second.names, second.values, strict=True))
    computed = bywire.simulate(moved_run(bench.run, fitted))
    clean = filtered(data.assign(theta=("time", computed["theta"])))
    third = inverse_dynamics(*problem, bandwidth=30.0, instruments=clean)
    return first, second, third


def apart(first, other):
    """Return unknowns whose two estimates differ by more than 3.5 standard deviations and 0.1 %."""
    names = [n for n in NAMES if n in first.names and n in other.names]
    reach = [np.hypot(*(e.deviations[e.names.index(n)] for e in (first, other))) for n in names]
    return [
        n
        for n, r in zip(names, reach, strict=True)
        if abs(first[n] - other[n]) > max(3.5 * r, 1e-3 * abs(other[n]))
    ]


if __name__ == "__main__":
    files = sys.argv[1:]  # a file with time [s], theta [rad] and v [V]
    try:
        first, second, third = identified(
            bywire.read_measurement(files[0]) if files else measured()
        )
    except bywire.BywireError as error:
        sys.exit(f"identify_servo_axis: {error}")
    print(f"residual angle: {NOISE * second.rms:.2g} rad (equals the encoder noise in a good fit)")
    print(f"output error\n{second}\n\ninverse dynamics with instruments\n{third}")
    for name in apart(first, second):
        print(f"{name}: noise biases inverse dynamics without instruments ({first[name]:.4g})")
    for name in apart(third, second):
        print(f"{name}: do not use this value. The equation of motion does not explain the record")
    if not files:
        for name, (low, high) in zip(NAMES, second.intervals(0.999), strict=False):
            assert low < getattr(TRUTH, name) < high, name
