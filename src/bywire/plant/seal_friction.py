"""Friction of the master cylinder's seals, a Stribeck curve that increases with pressure."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    BreakawayFactor,
    InverseSpeed,
    RotaryDamping,
    Torque,
    TorquePerPressure,
)
from bywire.core.signals import Power, Signal


class Parameters(ParameterSet):
    """Asymmetric Stribeck friction, as torques at the motor shaft.

    Valid for pressures >= 0. At rest the friction is set-valued. It can have any value between its
    two breakaway torques, so the piston sticks completely.
    """

    T_pr: Torque
    """friction torque due to seal preload, at zero pressure"""
    f_cfr_p: TorquePerPressure
    """growth of the Coulomb torque with pressure in the apply direction"""
    f_cfr_n: TorquePerPressure
    """growth of the Coulomb torque with pressure in the release direction"""
    k_brk_p: BreakawayFactor
    """ratio of breakaway torque to Coulomb torque in the apply direction"""
    k_brk_n: BreakawayFactor
    """ratio of breakaway torque to Coulomb torque in the release direction"""
    c: InverseSpeed
    """decay of the Stribeck peak with speed"""
    mu_T: RotaryDamping
    """viscous friction torque per shaft speed"""


FAULTS = (
    ParameterFault(
        "swollen",
        "increased friction, by the same factor in both directions",
        ("T_pr", "f_cfr_p", "f_cfr_n"),
        1.9,
    ),
)


class Input(NamedTuple):
    """Shaft speed and chamber pressure."""

    omega: Annotated[float, Signal("rad/s", "motor speed", 0.5)]
    p: Annotated[float, Signal("Pa", "master-cylinder pressure", 2e6)]


class Output(NamedTuple):
    """Magnitudes of the friction torque in both directions, at the same speed."""

    T_p: Annotated[float, Signal("N*m", "friction torque, apply", 0.05)]
    T_n: Annotated[float, Signal("N*m", "friction torque, release", 0.05)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return the magnitudes of the friction torque at the motor shaft.

    .. math::
        T_{fr} = \pm T_{cf} (1 + (k_{brk} - 1) e^{-c |\Omega|}) + \mu_T \Omega, \quad
        T_{cf} = T_{pr} + f_{cfr} p_{mc}

    with k_brk and f_cfr for each direction. At rest these are the breakaway torques.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (16).
    """
    speed = ops.fabs(u.omega)
    decay = ops.decay(par.c * speed)
    p = ops.fmax(u.p, 0.0)
    T_cf_p = par.T_pr + par.f_cfr_p * p
    T_cf_n = par.T_pr + par.f_cfr_n * p
    viscous = par.mu_T * speed
    return Output(
        T_p=T_cf_p + viscous + (par.k_brk_p - 1.0) * T_cf_p * decay,
        T_n=T_cf_n + viscous + (par.k_brk_n - 1.0) * T_cf_n * decay,
    )


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat from sliding friction, >= 0."""
    friction = output(u, par)
    return ops.where(u.omega > 0, friction.T_p, friction.T_n) * ops.fabs(u.omega)
