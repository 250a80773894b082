"""Thermal model of a wheel brake: discs, pads, and calipers with fluid warm up, and pads fade."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Area, HeatCapacity, HeatConductance, Temperature, Unit, Weight
from bywire.core.signals import Energy, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.validity import first, within_limits

Convection = Annotated[float, Unit("W/(m**2*K)", 10.0), Field(ge=0, allow_inf_nan=False)]
Cooling = Annotated[
    float, Signal("W", "cooling by air", role=Role("sink", "air", book="heat", returns="any"))
]
Kelvin = Annotated[float, Signal("K", "temperature", 400.0), Ge(0)]
_STANDS = 1e-9  # fraction of v_ref below which the power of the speed is 0, without a slope


class Parameters(ParameterSet):
    """Three bodies with one temperature each.

    ``law``: with ``"lumped"``, the brake warms up. With ``"off"``, temperatures are constant and
    the pads keep their cold friction.
    """

    law: Literal["off", "lumped"]
    """whether the brake warms up"""
    C_d: HeatCapacity
    """heat capacity of the discs"""
    C_p: HeatCapacity
    """heat capacity of the pads"""
    C_f: HeatCapacity
    """heat capacity of the calipers with their fluid"""
    psi: Weight
    """fraction of the friction heat that enters the discs"""
    A: Area
    """disc surface area cooled by the air"""
    h_0: Convection
    """convection coefficient at rest"""
    h_1: Convection
    """increase in the heat transfer coefficient above h_0 at the speed v_ref"""
    v_ref: Annotated[float, Unit("m/s", 1.0), Field(gt=0, allow_inf_nan=False)]
    """reference speed of h_1"""
    epsilon: Weight
    """emissivity of the discs"""
    sigma: Annotated[float, Unit("W/(m**2*K**4)", 5.67e-8), Field(ge=0, allow_inf_nan=False)]
    """Stefan-Boltzmann constant"""
    G_dp: HeatConductance
    """thermal conductance from the discs to applied pads"""
    G_open: HeatConductance
    """thermal conductance from the discs to released pads"""
    G_pf: HeatConductance
    """thermal conductance from the pads to the calipers"""
    G_f: HeatConductance
    """thermal conductance from the calipers to the air"""
    T_a: Temperature
    """air temperature, and temperature of all bodies before the first stop"""
    T_1: Temperature
    """disc temperature up to which the pads keep their cold friction"""
    T_2: Temperature
    """disc temperature above which the pads are fully faded"""
    f: Weight
    """friction coefficient of fully faded pads, relative to cold pads"""
    T_boil: Temperature
    """boiling point of fresh fluid at atmospheric pressure"""
    T_wet: Temperature
    """boiling point of fluid with 3.7 % water at atmospheric pressure"""
    T_most: Temperature
    """disc temperature up to which the thermal model is valid"""

    @model_validator(mode="after")
    def _fades_upward(self) -> Parameters:
        if not self.T_1 < self.T_2:
            reason = "pads fade from T_1 to T_2"
            raise RuleError("T_1", shown(self.T_1, "K"), f"< T_2 = {shown(self.T_2, 'K')}", reason)
        return self


class State(NamedTuple):
    """Temperatures."""

    T_disc: Annotated[float, Signal("K", "disc temperature", 450.0), Ge(0)]
    T_pads: Annotated[float, Signal("K", "pad temperature", 400.0), Ge(0)]
    T_fluid: Annotated[float, Signal("K", "temperature of calipers and fluid", 320.0), Ge(0)]


class Factors(NamedTuple):
    """Factors of the derivatives: heat capacities."""

    T_disc: Annotated[float, Signal("J/K", "heat capacity of the discs", 1e3)]
    T_pads: Annotated[float, Signal("J/K", "heat capacity of the pads", 1e3)]
    T_fluid: Annotated[float, Signal("J/K", "heat capacity of the calipers", 1e3)]


class Balance(NamedTuple):
    """Heat sources."""

    T_disc: Annotated[float, Signal("W", "heat into the discs", 1e4)]
    T_pads: Annotated[float, Signal("W", "heat into the pads", 1e3)]
    T_fluid: Annotated[float, Signal("W", "heat into the calipers", 100.0)]


class Input(NamedTuple):
    """Friction power of the brake, vehicle speed, and whether pads press on the discs.

    The power comes from the set-valued friction. It is limit times speed while the wheel turns, and
    0 at standstill, because a locked wheel heats its tire and not the brake.
    """

    P: Annotated[float, Signal("W", "friction power of the brake", 3e4), Ge(0)]
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    pressed: Annotated[float, Signal("1", "pads are applied"), Ge(0), Le(1)]


class Stored(NamedTuple):
    """Heat above the air temperature."""

    discs: Annotated[float, Signal("J", "heat in the discs", 1e5)]
    pads: Annotated[float, Signal("J", "heat in the pads", 1e4)]
    fluid: Annotated[float, Signal("J", "heat in calipers and fluid", 1e4)]


class Flows(NamedTuple):
    """Heat flows between the bodies, and from the bodies to the air."""

    disc_air: Annotated[float, Signal("W", "cooling of the discs", 1e3)]
    disc_pads: Annotated[float, Signal("W", "heat from discs to pads", 100.0)]
    pads_fluid: Annotated[float, Signal("W", "heat from pads to calipers", 100.0)]
    fluid_air: Annotated[float, Signal("W", "cooling of the calipers", 10.0)]


def friction(
    T_disc: Kelvin, par: Parameters
) -> Annotated[float, Signal("1", "friction relative to cold pads", 1.0)]:
    r"""Return the pad friction relative to cold pads.

    .. math:: \mu/\mu_0 = 1 - (1 - f)\, \mathrm{clip}((T_d - T_1)/(T_2 - T_1), 0, 1)
    """
    if par.law == "off":
        return 1.0
    return 1.0 - (1.0 - par.f) * ops.clip((T_disc - par.T_1) / (par.T_2 - par.T_1), 0.0, 1.0)


def convection(
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)], par: Parameters
) -> Annotated[float, Signal("W/(m**2*K)", "convection", 50.0)]:
    r"""Return the convection at a speed, :math:`h = h_0 + h_1 |v/v_{ref}|^{0.8}`."""
    ratio = ops.fabs(v) / par.v_ref
    grown = ops.power(ops.fmax(ratio, _STANDS), 0.8)
    return par.h_0 + par.h_1 * ops.where(ratio > _STANDS, grown, 0.0)


def flows(x: State, u: Input, par: Parameters) -> Flows:
    r"""Return the heat flows between the bodies, and to the air.

    .. math::
        P_{da} &= h A (T_d - T_a) + \varepsilon \sigma A (T_d^4 - T_a^4) \\
        P_{dp} &= G_{dp} (T_d - T_p), \quad P_{pf} = G_{pf} (T_p - T_f), \quad
        P_{fa} = G_f (T_f - T_a)
    """
    warmer = x.T_disc - par.T_a
    # T_d^4 - T_a^4 in factors, which lose no digits near the air temperature
    radiated = (x.T_disc * x.T_disc + par.T_a * par.T_a) * (x.T_disc + par.T_a) * warmer
    through = par.G_open + (par.G_dp - par.G_open) * u.pressed
    return Flows(
        disc_air=par.A * (convection(u.v, par) * warmer + par.epsilon * par.sigma * radiated),
        disc_pads=through * (x.T_disc - x.T_pads),
        pads_fluid=par.G_pf * (x.T_pads - x.T_fluid),
        fluid_air=par.G_f * (x.T_fluid - par.T_a),
    )


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: the heat capacities."""
    return Factors(T_disc=par.C_d, T_pads=par.C_p, T_fluid=par.C_f)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the net heat flow into each body.

    .. math::
        C_d \dot T_d &= \psi P - P_{da} - P_{dp} \\
        C_p \dot T_p &= (1 - \psi) P + P_{dp} - P_{pf} \\
        C_f \dot T_f &= P_{pf} - P_{fa}
    """
    if par.law == "off":
        return Balance(0.0, 0.0, 0.0)
    out = flows(x, u, par)
    return Balance(
        T_disc=par.psi * u.P - out.disc_air - out.disc_pads,
        T_pads=(1.0 - par.psi) * u.P + out.disc_pads - out.pads_fluid,
        T_fluid=out.pads_fluid - out.fluid_air,
    )


def stored(x: State, par: Parameters) -> Stored:
    """Return the heat in each body."""
    if par.law == "off":
        return Stored(0.0, 0.0, 0.0)
    return Stored(
        discs=par.C_d * (x.T_disc - par.T_a),
        pads=par.C_p * (x.T_pads - par.T_a),
        fluid=par.C_f * (x.T_fluid - par.T_a),
    )


def energy(x: State, par: Parameters) -> Energy:
    """Return the heat in all bodies."""
    each = stored(x, par)
    return each.discs + each.pads + each.fluid


def power_in(u: Input, par: Parameters) -> Power:
    """Return the friction power if it heats the brake."""
    return 0.0 if par.law == "off" else u.P


def power_loss(x: State, u: Input, par: Parameters) -> Cooling:
    """Return the heat flow to the air (signed: negative if the air is warmer)."""
    if par.law == "off":
        return 0.0
    out = flows(x, u, par)
    return out.disc_air + out.fluid_air


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if the fluid may boil, or if the discs exceed the valid range of the parameters."""
    if par.law == "off":
        return []
    boils = "the brake fluid exceeds the boiling point of {} fluid, {},".format
    vapor = ". Vapor costs stroke, but this model does not simulate that"
    wet, fresh, most = (shown(T, "K") for T in (par.T_wet, par.T_boil, par.T_most))
    return [
        *first(t, x.T_fluid > par.T_wet, boils("wet", wet), vapor),
        *first(t, x.T_fluid > par.T_boil, boils("fresh", fresh), vapor),
        *first(t, x.T_disc > par.T_most, f"the discs exceed {most}, the end of their valid range,"),
    ]
