"""The motorcycle brake's linear models: eqs. (14), (15), (21), (22) of Dardanelli et al. (2010)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.reduction import ReductionError, reduction_error
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.errors import ParameterError
from bywire.core.typing import Array, Complex
from bywire.plant import ball_screw_gear, brake_fluid, caliper, master_cylinder, pipeline

_BAR = 1e5


@dataclass(frozen=True)
class Rational:
    """A transfer function from current to pressure, SI.

    ``name``: what figures and messages call it; ``num``, ``den``: coefficients of numerator [Pa/A]
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
        """Zeros [rad/s], the slowest first."""
        return _sorted_roots(self.num)

    @property
    def poles(self) -> Complex:
        """Poles [rad/s], the slowest first."""
        return _sorted_roots(self.den)

    @property
    def zeros_hz(self) -> Array:
        """Frequencies of the zeros [Hz], the slowest first."""
        return np.abs(self.zeros) / (2.0 * math.pi)

    @property
    def poles_hz(self) -> Array:
        """Frequencies of the poles [Hz], the slowest first."""
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
            Times [s]; the response is 0 before 0.

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
        """Return it as ``control.TransferFunction`` [Pa/A]."""
        import control

        return control.tf(list(self.num), list(self.den), name=self.name)


def first_orders(
    name: str, gain: float, zeros_hz: tuple[float, ...], poles_hz: tuple[float, ...]
) -> Rational:
    r"""Return the transfer function of eqs. (21) and (22).

    .. math:: G = K \prod (1 + s \tau_j) / \prod (1 + s T_k)

    ``name``: what figures and messages call it; ``gain``: static gain K [Pa/A]; ``zeros_hz``,
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

    ``a_p``: speed by pressure [rad/(s^2 Pa)]; ``a_T``: speed by torque [rad/(s^2 N m)];
    ``a_Omega``: speed by speed [1/s]; ``b_p``, ``c_p``: equalization of the two pressures [1/s];
    ``b_Omega``: pressure by speed [Pa/rad].
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

    with the compliances C_mc = V_mc/beta and C_pd = A_pd^2/K_pd of the paper's laws.

    Parameters
    ----------
    par
        Parameters; other laws of gear, fluid and caliper give their own slopes.
    p
        Pressure [Pa]; acts with air or a nonlinear caliper only.
    x
        Piston travel [m]; ``x_nominal`` by default.

    Notes
    -----
    The viscous friction is the plant's torque per shaft speed, mu_T = k_g mu_F.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (14).
    """
    if par.caliper.leak == "leaking" or par.port.law == "leaking":
        raise ParameterError(
            "eq. (14) knows no leak, with which no pressure stays: take caliper.leak = 'tight' and "
            "port.law = 'makeup', or simulate"
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

    ``par``, ``p``, ``x``: as in `coefficients`.
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
    r"""Return eq. (15), pressure over motor current.

    .. math::
        \frac{P}{I} = K_e \frac{a_T}{a_p} \frac{1 + s T_p}{\frac{m \tau}{a_p} s^3 +
        \frac{m (1 + a_\Omega \tau)}{a_p} s^2 + (\frac{m a_\Omega}{a_p} + T_p) s + 1}, \quad
        T_p = \frac{1}{c_p}, \; m = \frac{1 + b_p T_p}{b_\Omega}, \; \tau = \frac{T_p}{m b_\Omega}

    (the paper's mu is m here).

    ``par``, ``p``, ``x``: as in `coefficients`.

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

    ``par``, ``p``, ``x``: as in `coefficients`.

    Notes
    -----
    The zero is what it costs: 160 Hz beside the second pole's 9.75 Hz in Table 2, the fast pole
    lies at 47 kHz. `two_pole_error` tells how much.

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
    """Return how far eq. (21) is off eq. (15) up to a frequency [Hz].

    ``par``, ``p``, ``x``: as in `coefficients`; ``high``: end of the band [Hz].
    """
    whole, less = linear_model(par, p, x), two_pole(par, p, x)
    a_2, a_1, _ = less.den
    simplified = replace(
        whole,
        name="eq-21",
        A=np.array([[0.0, 1.0], [-1.0 / a_2, -a_1 / a_2]]),
        B=np.array([[0.0], [less.gain / a_2]]),
        C=np.array([[1.0, 0.0]]),
        states=("p_mc", "rate"),
        state_units=("Pa", "Pa/s"),
        rate=np.zeros(2),
    )
    return reduction_error(whole, simplified, high)


def with_slow_pair(K: float, tau_L: float, T_1: float, T_2: float, T_L: float) -> Rational:
    r"""Return eq. (22): eq. (21) with a slow pair of a zero and a pole.

    .. math:: G = \frac{K (1 + s \tau_L)}{(1 + s T_1)(1 + s T_2)(1 + s T_L)}

    Parameters
    ----------
    K
        Static gain [Pa/A].
    tau_L, T_L
        Time constants of the slow zero and pole [s]: a response that creeps on after its step
        where tau_L < T_L, one that overshoots and falls where tau_L > T_L.
    T_1, T_2
        Time constants of the brake [s].

    Raises
    ------
    ParameterError
        When a time constant is not positive.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (22); Table 4 has the corner frequencies
    1/(2 pi T) of three pressure regions: below 10 bar, 10 to 35 bar, above 35 bar.
    """
    for name, T in (("tau_L", tau_L), ("T_1", T_1), ("T_2", T_2), ("T_L", T_L)):
        if not 0.0 < T < math.inf:
            raise ParameterError(f"{name} = {T:g} s is not valid: it must be > 0 s and finite")
    corners = tuple(1.0 / (2.0 * math.pi * T) for T in (T_1, T_2, T_L))
    return first_orders("eq-22", K, (1.0 / (2.0 * math.pi * tau_L),), corners)
