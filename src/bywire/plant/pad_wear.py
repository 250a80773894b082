"""Brake pads: wear due to friction work, and pad compliance in the caliper."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Area, Unit
from bywire.core.signals import ContactCompliance, Signal

Count = Annotated[float, Unit("1", 2.0), Field(ge=1, allow_inf_nan=False)]
WearPerWork = Annotated[float, Unit("m**3/J", 3e-14), Field(gt=0, allow_inf_nan=False)]
AbsoluteTemperature = Annotated[float, Unit("K", 400.0), Field(gt=0, le=2000, allow_inf_nan=False)]
Activation = Annotated[float, Unit("delta_degC", 3e3), Field(ge=0, allow_inf_nan=False)]
Modulus = Annotated[float, Unit("Pa", 5e8), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Pads that share the friction work of one brake, or of all brakes on an axle."""

    kappa_0: WearPerWork
    """wear volume per friction work below T_hot"""
    T_hot: AbsoluteTemperature
    """temperature above which wear increases"""
    T_act: Activation
    """activation energy divided by the gas constant; it determines the wear above T_hot"""
    n_pads: Count
    """number of pads that share the work"""
    A_pad: Area
    """lining area of one pad"""
    E_pad: Modulus
    """lining modulus across its thickness"""


class Input(NamedTuple):
    """Friction power, and temperature of the friction surface."""

    P: Annotated[float, Signal("W", "friction power", 1e4)]
    T: Annotated[float, Signal("K", "temperature of the friction surface", 400.0), Gt(0)]


class Output(NamedTuple):
    """Wear rate of each pad."""

    rate: Annotated[float, Signal("m/s", "wear rate of a pad", 1e-7)]


def wear_per_work(
    T: Annotated[float, Signal("K", "temperature of the friction surface", 400.0), Gt(0)],
    par: Parameters,
) -> Annotated[float, Signal("m**3/J", "wear per friction work", 3e-14)]:
    r"""Return the wear volume per friction work.

    .. math:: \kappa = \kappa_0 \exp\left(T_{act} (1/T_{hot} - 1/\max(T, T_{hot}))\right)

    Notes
    -----
    This is Archard's law in energy form. His coefficient is kappa times the friction coefficient.
    """
    return par.kappa_0 * ops.exp(par.T_act / par.T_hot - par.T_act / ops.fmax(T, par.T_hot))


def output(u: Input, par: Parameters) -> Output:
    r"""Return the wear rate of each pad, :math:`\dot h = \kappa(T) P / (n_{pads} A_{pad})`."""
    return Output(rate=wear_per_work(u.T, par) * u.P / (par.n_pads * par.A_pad))


def compliance(
    h: Annotated[float, Signal("m", "thickness of a pad", 0.01)], par: Parameters
) -> ContactCompliance:
    r"""Return the compliance of the two pads of a caliper, :math:`2 h / (E_{pad} A_{pad})`."""
    return 2.0 * h / (par.E_pad * par.A_pad)


def stiffness(
    K_cal: Annotated[float, Signal("N/m", "stiffness with new pads", 3e7), Gt(0)],
    worn: Annotated[float, Signal("m", "wear of a pad", 1e-3)],
    par: Parameters,
) -> Annotated[float, Signal("N/m", "stiffness of caliper and pads", 3e7)]:
    r"""Return the stiffness of a caliper with worn pads.

    .. math:: 1/K = 1/K_{cal} - 2\,\Delta h / (E_{pad} A_{pad})
    """
    return 1.0 / (1.0 / K_cal - compliance(worn, par))
