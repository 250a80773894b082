"""Permanent-magnet synchronous motor in rotor coordinates: windings, torque, iron loss."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import FluxLinkage, Inductance, PolePairs, Resistance, Unit
from bywire.core.signals import Energy, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.validity import within_limits
from bywire.plant import flux_map

Hysteresis = Annotated[float, Unit("W/(V**2*s)", 10.0), Field(ge=0, allow_inf_nan=False)]
Eddy = Annotated[float, Unit("W/V**2", 1e-3), Field(ge=0, allow_inf_nan=False)]
MotorSpeed = Annotated[float, Signal("rad/s", "motor speed", 100.0)]
Loss = Annotated[float, Signal("W", "copper loss", role=Role("sink", "copper", split=True))]
IronLoss = Annotated[float, Signal("W", "iron loss", role=Role("sink", "iron"))]


class Parameters(ParameterSet):
    """Sinusoidal flux. Amplitudes refer to phase quantities.

    The d axis is along the magnets, and the q axis is 90 degrees (electrical) ahead. ``law``: with
    ``"linear"``, inductances are constant; surface magnets have ``L_d = L_q``, interior magnets
    ``L_d < L_q``. With ``"saturated"``, ``map`` contains the flux linkages of the currents. The
    magnets' flux linkage adds to them, so weaker magnets do not change the map. ``iron``: with
    ``"drag"``, the iron loss is a torque against the rotation, and not a current.
    """

    law: Literal["linear", "saturated"]
    """relation between currents and flux linkages"""
    p: PolePairs
    """number of pole pairs"""
    R: Resistance
    """phase resistance"""
    L_d: Inductance
    """d-axis inductance (law "linear")"""
    L_q: Inductance
    """q-axis inductance (law "linear")"""
    map: flux_map.Parameters
    """flux linkages of the currents (law "saturated"); otherwise empty tables"""
    psi: FluxLinkage
    """amplitude of the magnet flux linkage"""
    iron: Literal["off", "drag"]
    """whether the iron has losses"""
    c_h: Hysteresis
    """hysteresis loss coefficient (iron "drag")"""
    c_e: Eddy
    """eddy-current loss coefficient (iron "drag")"""

    @model_validator(mode="after")
    def _has_a_map(self) -> Parameters:
        if self.law == "saturated" and not self.map.i_d:
            raise RuleError("map.i_d", "an empty table", "a table if law = 'saturated'")
        return self


FAULTS = (
    ParameterFault("hot", "hot windings or a bad contact", ("R",), 2.0),
    ParameterFault("demagnetized", "weaker magnets", ("psi",), 0.7),
)


class State(NamedTuple):
    """Currents in rotor coordinates."""

    i_d: Annotated[float, Signal("A", "d-axis current", 5.0)]
    i_q: Annotated[float, Signal("A", "q-axis current", 5.0)]


class Factors(NamedTuple):
    """Factors of the currents' derivatives."""

    i_d: Annotated[float, Signal("H", "inductance", 1e-4)]
    i_q: Annotated[float, Signal("H", "inductance", 1e-4)]


class Balance(NamedTuple):
    """Right-hand sides of the currents."""

    i_d: Annotated[float, Signal("V", "voltage across the inductance", 5.0)]
    i_q: Annotated[float, Signal("V", "voltage across the inductance", 5.0)]


class Input(NamedTuple):
    """Voltages in rotor coordinates, and rotor speed."""

    v_d: Annotated[float, Signal("V", "d-axis voltage", 5.0)]
    v_q: Annotated[float, Signal("V", "q-axis voltage", 5.0)]
    omega: MotorSpeed


class Flux(NamedTuple):
    """Flux linkages in rotor coordinates."""

    psi_d: Annotated[float, Signal("V*s", "d-axis flux linkage", 6e-3)]
    psi_q: Annotated[float, Signal("V*s", "q-axis flux linkage", 1e-3)]


class Output(NamedTuple):
    """Motor torque, and the dry friction due to iron hysteresis."""

    torque: Annotated[float, Signal("N*m", "motor torque, with eddy-current drag", 0.3)]
    T_h: Annotated[float, Signal("N*m", "hysteresis torque, a dry friction", 1e-3)]


def flux(x: State, par: Parameters) -> Flux:
    r"""Return the flux linkages, :math:`\psi_d = \psi + L_d i_d`, :math:`\psi_q = L_q i_q`.

    With law "saturated", the map replaces the products of inductance and current.
    """
    if par.law == "saturated":
        own = flux_map.flux(flux_map.Currents(*x), par.map)
        return Flux(psi_d=par.psi + own.psi_d, psi_q=own.psi_q)
    return Flux(psi_d=par.psi + par.L_d * x.i_d, psi_q=par.L_q * x.i_q)


def mass(x: State, par: Parameters) -> Factors:
    r"""Return the factors of the currents' derivatives, which are the inductances.

    With law "saturated", they are those of one axis while the other axis is short-circuited,
    :math:`L_{dd} - L_{dq}^2/L_{qq}` and :math:`L_{qq} - L_{dq}^2/L_{dd}`.
    """
    if par.law == "saturated":
        L = flux_map.inductances(flux_map.Currents(*x), par.map)
        square = L.L_dq * L.L_dq
        return Factors(i_d=L.L_dd - square / L.L_qq, i_q=L.L_qq - square / L.L_dd)
    return Factors(i_d=par.L_d, i_q=par.L_q)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the voltages across the inductances.

    .. math::
        L_d \frac{di_d}{dt} = v_d - R i_d + \omega_e L_q i_q, \quad
        L_q \frac{di_q}{dt} = v_q - R i_q - \omega_e (L_d i_d + \psi), \quad
        \omega_e = p \omega

    With law "saturated", these voltages :math:`e_d` and :math:`e_q` are the derivatives of the flux
    linkages. The balance of the currents is then :math:`e_d - e_q L_{dq}/L_{qq}` and
    :math:`e_q - e_d L_{dq}/L_{dd}`.

    References
    ----------
    R. H. Park, "Two-Reaction Theory of Synchronous Machines", Trans. AIEE 48, 1929. The
    documentation of MathWorks' "MTPA Control Reference" has this form.
    """
    omega_e, f = par.p * u.omega, flux(x, par)
    e_d = u.v_d - par.R * x.i_d + omega_e * f.psi_q
    e_q = u.v_q - par.R * x.i_q - omega_e * f.psi_d
    if par.law == "saturated":
        L = flux_map.inductances(flux_map.Currents(*x), par.map)
        return Balance(i_d=e_d - L.L_dq / L.L_qq * e_q, i_q=e_q - L.L_dq / L.L_dd * e_d)
    return Balance(i_d=e_d, i_q=e_q)


def airgap_torque(
    x: State, par: Parameters
) -> Annotated[float, Signal("N*m", "air-gap torque", 0.3)]:
    r"""Return the torque due to the currents.

    .. math:: T = \tfrac{3}{2} p (\psi_d i_q - \psi_q i_d)
        = \tfrac{3}{2} p (\psi + (L_d - L_q) i_d) i_q

    The second form is valid for law "linear".
    """
    f = flux(x, par)
    return 1.5 * par.p * (f.psi_d * x.i_q - f.psi_q * x.i_d)


def output(x: State, omega: MotorSpeed, par: Parameters) -> Output:
    r"""Return the torque on the rotor, and the bound of the hysteresis friction.

    .. math::
        T_e = c_e p^2 \omega \psi_s^2, \quad T_h = c_h p \psi_s^2, \quad
        \psi_s^2 = \psi_d^2 + \psi_q^2

    Notes
    -----
    With a drag torque, the model has two states. The usual resistor across the windings would need
    two more states, and gives the same loss at constant speed. The hysteresis torque does not
    depend on the magnitude of the speed. It is a set-valued friction, which holds the rotor at
    rest.
    """
    T = airgap_torque(x, par)
    if par.iron == "off":
        return Output(torque=T, T_h=0.0 * T)
    hysteresis = par.c_h * par.p * _flux_square(x, par)
    return Output(torque=T - _eddy_slope(x, par) * omega, T_h=hysteresis)


def _flux_square(x: State, par: Parameters) -> float:
    f = flux(x, par)
    return f.psi_d * f.psi_d + f.psi_q * f.psi_q


def _eddy_slope(x: State, par: Parameters) -> float:
    """Return the eddy-current torque per speed."""
    return par.c_e * par.p * par.p * _flux_square(x, par)


def energy(x: State, par: Parameters) -> Energy:
    r"""Return the magnetic energy, :math:`\tfrac{3}{4} (L_d i_d^2 + L_q i_q^2)`.

    With law "saturated", it is :math:`\tfrac{3}{2} (\psi_d i_d + \psi_q i_q - W')`, with the flux
    linkages of the currents and their coenergy W'.
    """
    if par.law == "saturated":
        i = flux_map.Currents(*x)
        own = flux_map.flux(i, par.map)
        return 1.5 * (own.psi_d * x.i_d + own.psi_q * x.i_q - flux_map.coenergy(i, par.map))
    return 0.75 * (par.L_d * x.i_d * x.i_d + par.L_q * x.i_q * x.i_q)


def electrical_power(x: State, u: Input) -> Power:
    r"""Return the power at the terminals, :math:`\tfrac{3}{2} (v_d i_d + v_q i_q)`."""
    return 1.5 * (u.v_d * x.i_d + u.v_q * x.i_q)


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the electrical power minus the power of the air-gap torque."""
    return electrical_power(x, u) - airgap_torque(x, par) * u.omega


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the copper loss, >= 0."""
    return 1.5 * par.R * (x.i_d * x.i_d + x.i_q * x.i_q)


def iron_loss(x: State, omega: MotorSpeed, par: Parameters) -> IronLoss:
    """Return the eddy-current loss, >= 0. The model's dry friction contains the hysteresis."""
    return 0.0 * omega if par.iron == "off" else _eddy_slope(x, par) * omega * omega


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if the currents leave the flux map."""
    if par.law == "linear":
        return []
    return list(flux_map.watch(t, flux_map.Currents(*x), par.map))
