"""Linear models of the motorcycle brake: the plant from the paper's equations, the ECU's loops."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from bywire.analysis.crossings import Margin, margin
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.analysis.reduction import ReductionError, reduction_error
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import EcuParameters, MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.control import current_pi, low_pass_2, pressure_pid
from bywire.core.errors import ParameterError, not_valid
from bywire.core.signals import signals_of, zeros
from bywire.core.typing import Array, Complex
from bywire.plant import ball_screw_gear, brake_fluid, caliper, master_cylinder, pipeline

_BAR = 1e5


@dataclass(frozen=True)
class Rational:
    """A transfer function from current to pressure, SI.

    ``name``: name in figures and messages; ``num``, ``den``: coefficients of numerator [Pa/A]
    and denominator, highest power of s first.
    """

    name: str
    num: tuple[float, ...]
    den: tuple[float, ...]

    @property
    def gain(self) -> float:
        """Static gain [Pa/A]."""
        return self.num[-1] / self.den[-1]

    @property
    def gain_bar(self) -> float:
        """Static gain [bar/A]."""
        return self.gain / _BAR

    @property
    def zeros(self) -> Complex:
        """Zeros [rad/s], slowest first."""
        return _sorted_roots(self.num)

    @property
    def poles(self) -> Complex:
        """Poles [rad/s], slowest first."""
        return _sorted_roots(self.den)

    @property
    def zeros_hz(self) -> Array:
        """Frequencies of the zeros [Hz], slowest first."""
        return np.abs(self.zeros) / (2.0 * math.pi)

    @property
    def poles_hz(self) -> Array:
        """Frequencies of the poles [Hz], slowest first."""
        return np.abs(self.poles) / (2.0 * math.pi)

    def response(self, frequencies: Array) -> Complex:
        """Return the frequency response [Pa/A] at frequencies [Hz], shape (n,)."""
        s = 2j * math.pi * np.asarray(frequencies, dtype=float)
        return np.asarray(np.polyval(self.num, s) / np.polyval(self.den, s))

    def step(self, t: Array) -> Array:
        r"""Return the response to a unit step at t = 0 [Pa/A], by partial fractions.

        .. math:: y = K + \sum_k \frac{b(\lambda_k)}{\lambda_k a'(\lambda_k)} e^{\lambda_k t}

        Parameters
        ----------
        t
            Times [s]; the response is 0 for negative times.

        Notes
        -----
        Valid for simple poles, none at zero, and more poles than zeros.
        """
        slope = np.polyder(np.array(self.den))
        after = np.maximum(np.asarray(t, dtype=float), 0.0)
        y = np.full(after.shape, self.gain, dtype=complex)
        for pole in self.poles:
            share = np.polyval(self.num, pole) / (pole * np.polyval(slope, pole))
            y += share * np.exp(pole * after)
        return np.where(np.asarray(t) >= 0.0, y.real, 0.0)

    def transfer_function(self) -> Any:
        """Return the model as ``control.TransferFunction`` [Pa/A]."""
        import control

        return control.tf(list(self.num), list(self.den), name=self.name)


def first_orders(
    name: str, gain: float, zeros_hz: tuple[float, ...], poles_hz: tuple[float, ...]
) -> Rational:
    r"""Return the transfer function of eqs. (21) and (22).

    .. math:: G = K \prod (1 + s \tau_j) / \prod (1 + s T_k)

    ``name``: name in figures and messages; ``gain``: static gain K [Pa/A]; ``zeros_hz``,
    ``poles_hz``: corner frequencies 1/(2 pi tau_j) and 1/(2 pi T_k) [Hz].
    """

    def product(corners: tuple[float, ...]) -> Array:
        coefficients: Array = np.ones(1)
        for hertz in corners:
            factor = [1.0 / (2.0 * math.pi * hertz), 1.0]
            coefficients = np.asarray(np.polymul(coefficients, factor))
        return coefficients

    return Rational(
        name, tuple(float(v) for v in gain * product(zeros_hz)), tuple(product(poles_hz).tolist())
    )


def _sorted_roots(coefficients: tuple[float, ...]) -> Complex:
    roots = np.roots(coefficients).astype(np.complex128)
    return roots[np.argsort(np.abs(roots))]


# --- The brake

Par = MotorcycleParameters


@dataclass(frozen=True)
class Coefficients:
    r"""Coefficients of eq. (14), SI.

    .. math::
        \dot{\delta\Omega} &= -a_p \delta p_{mc} + a_T \delta T - a_\Omega \delta\Omega \\
        \dot{\delta p}_{mc} &= b_p (\delta p_{pd} - \delta p_{mc}) + b_\Omega \delta\Omega \\
        \dot{\delta p}_{pd} &= c_p (\delta p_{mc} - \delta p_{pd})

    ``a_p``: from pressure to speed [rad/(s^2 Pa)]; ``a_T``: from torque to speed [rad/(s^2 N m)];
    ``a_Omega``: from speed to speed [1/s]; ``b_p``, ``c_p``: equalization of the two pressures
    [1/s]; ``b_Omega``: from speed to pressure [Pa/rad].
    """

    a_p: float
    a_T: float
    a_Omega: float
    b_p: float
    b_Omega: float
    c_p: float


def coefficients(par: Par, p: float = 20e5, x: float | None = None) -> Coefficients:
    r"""Return the coefficients of eq. (14) at rest.

    .. math::
        a_T = \eta_g/M', \quad a_p = A_{mc} k_g/M', \quad
        a_\Omega = (k_g^2 k_{damp} + \mu_T)/M', \quad
        b_p = 1/(C_{mc} K_{lf}), \quad b_\Omega = A_{mc} k_g/C_{mc}, \quad c_p = 1/(C_{pd} K_{lf})

    with the compliances C_mc = V_mc/beta and C_pd = A_pd^2/K_pd from the paper's laws.

    Parameters
    ----------
    par
        Parameters. Other laws of gear, fluid and caliper contribute their own slopes.
    p
        Pressure [Pa]; relevant only with air or a nonlinear caliper.
    x
        Piston travel [m]. Default: ``x_nominal``.

    Notes
    -----
    The viscous friction is the plant's torque per shaft speed, mu_T = k_g mu_F.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (14).
    """
    if par.caliper.leak == "leaking" or par.port.law == "leaking":
        raise ParameterError(
            "eq. (14) of Dardanelli et al. does not include leaks, and a leaking brake has no "
            "equilibrium. Set "
            "caliper.leak = 'tight' and port.law = 'makeup', or use a simulation",
            name="caliper.leak" if par.caliper.leak == "leaking" else "port.law",
            value="'leaking'",
        )
    k_g, A_mc = par.gear.k_g, par.master_cylinder.A_mc
    M = ball_screw_gear.inertia(par.gear)
    eta = par.gear.eta_g if par.gear.law == "paper" else 1.0
    travel = par.master_cylinder.x_nominal if x is None else x
    at = master_cylinder.Input(x=travel, v=0.0, q=0.0)
    volume = master_cylinder.volume(at, par.master_cylinder)
    C_mc = brake_fluid.compliance(brake_fluid.Chamber(V=volume, p=p), par.fluid)
    C_pd = caliper.mass(caliper.State(p), par.caliper, par.fluid)
    K_lf = pipeline.resistance(par.pipeline, par.fluid)
    return Coefficients(
        a_p=A_mc * k_g / M,
        a_T=eta / M,
        a_Omega=(k_g * k_g * par.master_cylinder.k_damp + par.seal.mu_T) / M,
        b_p=1.0 / (C_mc * K_lf),
        b_Omega=A_mc * k_g / C_mc,
        c_p=1.0 / (C_pd * K_lf),
    )


def linear_model(par: Par, p: float = 20e5, x: float | None = None) -> LinearModel:
    """Return eq. (14) with the motor current as input and the pressure p_mc as output.

    ``par``, ``p``, ``x``: see `coefficients`.
    """
    c = coefficients(par, p, x)
    return LinearModel(
        name="eq-14",
        A=np.array(
            [
                [-c.a_Omega, -c.a_p, 0.0],
                [c.b_Omega, -c.b_p, c.b_p],
                [0.0, c.c_p, -c.c_p],
            ]
        ),
        B=np.array([[c.a_T * par.motor.K_e], [0.0], [0.0]]),
        C=np.array([[0.0, 1.0, 0.0]]),
        D=np.zeros((1, 1)),
        states=("omega", "p_mc", "p_pd"),
        inputs=("i_source",),
        outputs=("p_mc",),
        state_units=("rad/s", "Pa", "Pa"),
        input_units=("A",),
        output_units=("Pa",),
        rate=np.zeros(3),
    )


def theoretical(par: Par, p: float = 20e5, x: float | None = None) -> Rational:
    r"""Return eq. (15), the transfer function from motor current to pressure.

    .. math::
        \frac{P}{I} = K_e \frac{a_T}{a_p} \frac{1 + s T_p}{\frac{m \tau}{a_p} s^3 +
        \frac{m (1 + a_\Omega \tau)}{a_p} s^2 + (\frac{m a_\Omega}{a_p} + T_p) s + 1}, \quad
        T_p = \frac{1}{c_p}, \; m = \frac{1 + b_p T_p}{b_\Omega}, \; \tau = \frac{T_p}{m b_\Omega}

    (the paper's mu is m here).

    ``par``, ``p``, ``x``: see `coefficients`.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (15).
    """
    c = coefficients(par, p, x)
    T_p = 1.0 / c.c_p
    m = (1.0 + c.b_p * T_p) / c.b_Omega
    tau = T_p / (m * c.b_Omega)
    gain = par.motor.K_e * c.a_T / c.a_p
    return Rational(
        name="eq-15",
        num=(gain * T_p, gain),
        den=(
            m * tau / c.a_p,
            m * (1.0 + c.a_Omega * tau) / c.a_p,
            m * c.a_Omega / c.a_p + T_p,
            1.0,
        ),
    )


def two_pole(par: Par, p: float = 20e5, x: float | None = None) -> Rational:
    r"""Return eq. (21): eq. (15) without its zero and its fast, hydraulic pole.

    .. math:: G = \frac{K}{(1 + s T_1)(1 + s T_2)}

    ``par``, ``p``, ``x``: see `coefficients`.

    Notes
    -----
    In Table 2 the zero is at 160 Hz, the second pole at 9.75 Hz and the fast pole at 47 kHz, so
    most of the error comes from the zero. `two_pole_error` computes it.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (21).
    """
    whole = theoretical(par, p, x)
    first, second = whole.poles[:2]
    product = complex(first * second).real
    den = (1.0 / product, -complex(first + second).real / product, 1.0)
    return Rational("eq-21", (whole.gain,), den)


def two_pole_error(
    par: Par, p: float = 20e5, x: float | None = None, high: float = 50.0
) -> ReductionError:
    """Return the error of eq. (21) relative to eq. (15) up to a frequency [Hz].

    ``par``, ``p``, ``x``: as in `coefficients`; ``high``: upper limit of the band [Hz].
    """
    whole, reduced = linear_model(par, p, x), two_pole(par, p, x)
    a_2, a_1, _ = reduced.den
    simplified = replace(
        whole,
        name="eq-21",
        A=np.array([[0.0, 1.0], [-1.0 / a_2, -a_1 / a_2]]),
        B=np.array([[0.0], [reduced.gain / a_2]]),
        C=np.array([[1.0, 0.0]]),
        states=("p_mc", "rate"),
        state_units=("Pa", "Pa/s"),
        rate=np.zeros(2),
    )
    return reduction_error(whole, simplified, high)


def with_slow_pair(K: float, tau_L: float, T_1: float, T_2: float, T_L: float) -> Rational:
    r"""Return eq. (22): eq. (21) with a slow zero-pole pair.

    .. math:: G = \frac{K (1 + s \tau_L)}{(1 + s T_1)(1 + s T_2)(1 + s T_L)}

    Parameters
    ----------
    K
        Static gain [Pa/A].
    tau_L, T_L
        Time constants of the slow zero and pole [s]. The step response creeps upward if
        tau_L < T_L; it overshoots and falls if tau_L > T_L.
    T_1, T_2
        Time constants of the brake [s].

    Raises
    ------
    ParameterError
        When a time constant is not positive.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (22); Table 4 lists the corner frequencies
    1/(2 pi T) for three pressure regions: below 10 bar, 10 to 35 bar, above 35 bar.
    """
    for name, T in (("tau_L", tau_L), ("T_1", T_1), ("T_2", T_2), ("T_L", T_L)):
        if not 0.0 < T < math.inf:
            raise not_valid(name, f"{T:g} s", "> 0 s and finite")
    corners = tuple(1.0 / (2.0 * math.pi * T) for T in (T_1, T_2, T_L))
    return first_orders("eq-22", K, (1.0 / (2.0 * math.pi * tau_L),), corners)


# --- The ECU's control laws, current loop and pressure loop
# Scheduled gains are frozen at the pressure: the schedule is bumpless, so it does not affect
# the linear model of small motion about an equilibrium.

Rotor = Literal["locked", "free"]
_Law = Callable[[Any, Any], tuple[Any, Any]]


def pressure_feedback(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p from minus the measured pressure [Pa] to the demand [A]."""
    return _pressure_law(
        "pressure-feedback", ecu, p, lambda u: pressure_pid.Input(p_ref=0.0 * u, p_meas=-u)
    )


def pressure_demand(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p [Pa] from the set point [Pa] to the current demand [A]."""
    return _pressure_law(
        "pressure-demand", ecu, p, lambda u: pressure_pid.Input(p_ref=u, p_meas=0.0 * u)
    )


def _pressure_control(ecu: EcuParameters, p: float) -> LinearModel:
    """Return the PID at a pressure p from set point and measurement [Pa] to the demand [A]."""
    return _pressure_law(
        "pressure-control",
        ecu,
        p,
        lambda u: pressure_pid.Input(p_ref=u[0], p_meas=u[1]),
        ("p_ref", "p_meas"),
    )


def _pressure_law(
    name: str,
    ecu: EcuParameters,
    p: float,
    signals: Callable[[Any], pressure_pid.Input],
    inputs: tuple[str, ...] = ("in",),
) -> LinearModel:
    """Return the PID at a pressure p [Pa]; ``signals`` maps the model's inputs to the PID's."""
    gains = ecu.pressure_at(p)

    def law(x: pressure_pid.State, u: Any) -> tuple[Any, Any]:
        state, out = pressure_pid.output(x, signals(u), ecu.T_s, gains)
        return state, out.i

    return _linear(name, law, pressure_pid.State, ecu.T_s, ("Pa", "A"), inputs)


def current_control(ecu: EcuParameters) -> LinearModel:
    """Return the current PI from the current error [A] to the duty cycle."""

    def law(x: current_pi.State, u: Any) -> tuple[Any, Any]:
        signals = current_pi.Input(i_ref=u, i_meas=0.0 * u)
        state, out = current_pi.output(x, signals, ecu.T_s, ecu.current)
        return state, out.duty

    return _linear("current-control", law, current_pi.State, ecu.T_s, ("A", "1"))


def demand_filter(ecu: EcuParameters) -> LinearModel:
    """Return the low-pass filter between the pressure and current controllers."""

    def law(x: low_pass_2.State, u: Any) -> tuple[Any, Any]:
        state, out = low_pass_2.output(x, u, ecu.T_s, ecu.filter)
        return state, out.y

    return _linear("demand-filter", law, low_pass_2.State, ecu.T_s, ("A", "A"))


def current_loop(par: MotorcycleParameters, p: float, rotor: Rotor) -> LinearModel:
    """Return the loop from the set point ``i_set`` to the currents ``i`` and ``i_meas``.

    The model includes the PI at the ECU's sample time, battery and bridge, winding, and anti-alias
    filter. It neglects the converter's resolution.

    Parameters
    ----------
    par
        Parameters; the drive mode has no effect.
    p
        Pressure of the operating point [Pa].
    rotor
        ``"locked"``: no back-EMF, as if friction held the shaft. ``"free"``: the shaft moves
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
    law: _Law,
    state_type: Any,
    period: float,
    units: tuple[str, str],
    inputs: tuple[str, ...] = ("in",),
) -> LinearModel:
    """Return a control law's Jacobians at zero, inside all limits."""
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
"""frequency band of the search for margins [Hz]"""


@dataclass(frozen=True, eq=False)
class PressureLoop:
    """PID, low-pass filter, sampled current loop and anti-alias filters around a linear brake.

    The current loop has a locked rotor, because a model from current to pressure already contains
    the rotor's motion. Converters are ideal, and the dither is off.

    ``par``: parameters of ECU, motor, supply and filters; ``brake``: transfer function from motor
    current to pressure [Pa/A]; ``p``: pressure of the operating point [Pa].
    """

    par: MotorcycleParameters
    brake: Rational
    p: float = 25e5

    @cached_property
    def plant(self) -> LinearModel:
        """Sampled model from duty cycle to measured current, pressure, and measured pressure."""
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
        """Return the closed loop from set point to pressure at frequencies [Hz]."""
        drive = _gain(pressure_demand(self.par.ecu, self.p), frequencies)
        return drive * self._inner(frequencies, 1) / (1.0 + self.open(frequencies))

    def models(self) -> tuple[LinearModel, LinearModel]:
        """Return the loop gain (cut at the measured pressure) and the closed loop as models."""
        import control

        def block(model: LinearModel) -> Any:
            return control.ss(model.A, model.B, model.C, model.D, model.period)

        ecu, T = self.par.ecu, self.plant.period
        current = control.ss([], [], [], [[1.0, 0.0, 0.0]], T)
        inner = control.feedback(block(self.plant) * block(current_control(ecu)), current)
        path = inner * block(demand_filter(ecu))
        gain = path[2, 0] * block(pressure_feedback(ecu, self.p))
        # The measured pressure feeds back into the second input of the pressure control.
        ahead = path * block(_pressure_control(ecu, self.p))
        back = control.ss([], [], [], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], T)
        closed = control.feedback(ahead, back, sign=1)[1, 0]
        return _single(gain, "p_meas"), _single(closed, "p")

    def margin(self) -> Margin:
        """Return crossover and phase margin."""
        return margin(self.open, BAND)

    def _inner(self, frequencies: Array, output: int) -> Complex:
        """Return the response from the current demand to an output of the plant."""
        plant = self.plant.response(frequencies)[:, :, 0]
        pi = _gain(current_control(self.par.ecu), frequencies)
        current = pi / (1.0 + pi * plant[:, 0])
        return _gain(demand_filter(self.par.ecu), frequencies) * current * plant[:, output]


def _gain(law: LinearModel, frequencies: Array) -> Complex:
    return law.response(frequencies)[:, 0, 0]


def cancelling_pi(loop: PressureLoop, T: float, crossover: float) -> PressureLoop:
    """Return the loop with a PI whose zero cancels a time constant T [s].

    ``loop``: loop whose PID the PI replaces; ``T``: time constant [s]; ``crossover``: required
    crossover frequency [Hz].
    """
    unit = loop.par.replace(
        {"ecu.pressure.k_p": 1e-5, "ecu.pressure.k_i": 1e-5 / T, "ecu.pressure.k_d": 0.0}
    )
    gain = float(np.abs(PressureLoop(unit, loop.brake, loop.p).open(np.array([crossover])))[0])
    k_p = 1e-5 / gain
    tuned = unit.replace({"ecu.pressure.k_p": k_p, "ecu.pressure.k_i": k_p / T})
    return PressureLoop(tuned, loop.brake, loop.p)


def _single(block: Any, output: str) -> LinearModel:
    """Return a block with one input and one output pressure as a plain model."""
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
    """Return A, B, C of a strictly proper transfer function, with the fastest state first."""
    den = np.asarray(brake.den, dtype=float) / brake.den[0]
    n = den.size - 1
    num = np.asarray(brake.num, dtype=float) / brake.den[0]
    A = np.vstack([-den[1:], np.eye(n - 1, n)])
    return A, np.eye(n, 1), np.concatenate([np.zeros(n - num.size), num])[None]


def _cascade(motor: LinearModel, brake: Rational, f_aa: float) -> LinearModel:
    """Return motor, brake and the pressure channel's filter in series, in continuous time.

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
