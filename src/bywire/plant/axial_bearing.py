"""Preloaded axial bearings with friction due to preload, load, grease and the Stribeck effect."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Gain, KinematicViscosity, Torque, Unit
from bywire.core.signals import Power, Signal

TorquePerForce = Annotated[float, Unit("N*m/N", 1e-5), Field(ge=0, allow_inf_nan=False)]
TorquePerForceSquared = Annotated[float, Unit("N*m/N**2", 2e-9), Field(ge=0, allow_inf_nan=False)]
AngularSpeed = Annotated[float, Unit("rad/s", 10.0), Field(gt=0, allow_inf_nan=False)]
_STILL = 1e-9  # floor of the viscous term's argument, whose slope at zero is infinite


class Parameters(ParameterSet):
    """Coefficients of one shaft's bearings. The friction is set-valued at rest."""

    C_0: Torque
    """friction due to preload"""
    C_1: TorquePerForce
    """friction growth with axial force"""
    C_2: TorquePerForceSquared
    """friction growth with axial force squared"""
    T_nu: Torque
    """viscous friction at speed omega_ref and viscosity nu_ref"""
    omega_ref: AngularSpeed
    """reference speed of T_nu"""
    nu: KinematicViscosity
    """viscosity of the grease"""
    nu_ref: KinematicViscosity
    """reference viscosity of T_nu"""
    k_nu: Factor
    """exponent of the viscous term, 2/3 in bearing catalogs"""
    G_S: Gain
    """height of the Stribeck peak relative to the load-dependent friction"""
    k_S: Factor
    """exponent factor of the Stribeck peak"""
    omega_S: AngularSpeed
    """characteristic speed of the Stribeck peak"""


FAULTS = (ParameterFault("worn", "increased friction", ("C_0", "C_1", "C_2", "T_nu"), 5.0),)


class Input(NamedTuple):
    """Axial force and shaft speed."""

    force: Annotated[float, Signal("N", "axial force on the screw", 1000.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 3.0)]


def friction(u: Input, par: Parameters) -> Annotated[float, Signal("N*m", "bearing friction", 0.1)]:
    r"""Return the magnitude of the friction torque.

    .. math::
        T = T_A + T_\nu \left(\frac{\nu |\omega|}{\nu_{ref} \omega_{ref}}\right)^{k_\nu}
        + G_S e^{-k_S |\omega| / \omega_S} T_A, \quad T_A = C_0 + C_1 |F| + C_2 F^2

    Notes
    -----
    The paper's exponential contains the signed speed and would grow without bound in one direction.
    We use the magnitude. The grease term has a reference point, so no coefficient has a hidden
    unit. The paper writes ``G_nu (nu |omega|)^k_nu`` with nu in mm^2/s.

    References
    ----------
    Roberts et al. (2003), section "Rollerscrew and bearings".
    """
    axial = par.C_0 + par.C_1 * ops.fabs(u.force) + par.C_2 * u.force * u.force
    speed = ops.fabs(u.omega)
    ratio = par.nu / par.nu_ref * (speed / par.omega_ref)
    # The term is zero at rest, where kernels skip the power. The floor keeps its slope finite.
    churned = ops.where(ratio > _STILL, ops.power(ops.fmax(ratio, _STILL), par.k_nu), 0.0)
    viscous = par.T_nu * churned
    stribeck = par.G_S * axial * ops.decay(par.k_S * speed / par.omega_S, rests=True)
    return axial + viscous + stribeck


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat in the turning bearings, >= 0."""
    return friction(u, par) * ops.fabs(u.omega)
