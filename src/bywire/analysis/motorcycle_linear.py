"""The motorcycle brake's linear model: eqs. (14) and (15) of Dardanelli et al. (2010)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.analysis.linear_model import LinearModel
from bywire.analysis.rational import Rational
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.plant import ball_screw_gear, brake_fluid, caliper, master_cylinder, pipeline

Par = MotorcycleParameters


@dataclass(frozen=True)
class Coefficients:
    r"""Coefficients of eq. (14), SI.

    .. math::
        \dot{\delta\Omega} &= -a_p \delta p_{mc} + a_T \delta T - a_\Omega \delta\Omega \\
        \dot{\delta p}_{mc} &= b_p (\delta p_{pd} - \delta p_{mc}) + b_\Omega \delta\Omega \\
        \dot{\delta p}_{pd} &= c_p (\delta p_{mc} - \delta p_{pd})

    Parameters
    ----------
    a_p
        Speed by pressure [rad/(s^2 Pa)].
    a_T
        Speed by torque [rad/(s^2 N m)].
    a_Omega
        Speed by speed [1/s].
    b_p, c_p
        Equalization of the two pressures [1/s].
    b_Omega
        Pressure by speed [Pa/rad].
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

    Parameters
    ----------
    par, p, x
        As in `coefficients`.
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

    Parameters
    ----------
    par, p, x
        As in `coefficients`.

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


def theoretical_transfer_function(par: Par, p: float = 20e5, x: float | None = None) -> Any:
    """Return eq. (15) as ``control.TransferFunction`` [Pa/A]."""
    return theoretical(par, p, x).transfer_function()
