"""Master cylinder: piston, pressure chamber, and force on the piston."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge
from pydantic import model_validator

from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Area, Damping, Length
from bywire.core.signals import Energy, FluidCompliance, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.validity import within_limits
from bywire.plant import brake_fluid

Loss = Annotated[float, Signal("W", "fluid damping loss", role=Role("sink", "fluid damping"))]


class Parameters(ParameterSet):
    """Pressure chamber with piston, in gauge pressures."""

    A_mc: Area
    """piston area"""
    s_mc: Length
    """chamber length at zero travel, which equals the travel at which its volume would be zero"""
    x_rest: Length
    """travel of the retracted piston, at its near end stop and zero pressure"""
    x_end: Length
    """travel at which the piston reaches its end stop"""
    x_nominal: Length
    """travel at the nominal operating point"""
    k_damp: Damping
    """damping coefficient of the fluid"""

    @model_validator(mode="after")
    def _ordered(self) -> Parameters:
        if not self.x_nominal < self.s_mc:
            valid = f"< the chamber length s_mc = {shown(self.s_mc, 'm')}"
            raise RuleError("x_nominal", shown(self.x_nominal, "m"), valid)
        if not self.x_rest < self.x_end:
            raise RuleError(
                "x_end", shown(self.x_end, "m"), f"> x_rest = {shown(self.x_rest, 'm')}"
            )
        if not self.x_end < self.s_mc:
            raise RuleError(
                "x_end",
                shown(self.x_end, "m"),
                f"< the chamber length s_mc = {shown(self.s_mc, 'm')}",
                "move the end stop forward or lengthen the chamber",
            )
        return self


class State(NamedTuple):
    """Chamber pressure, gauge."""

    p: Annotated[float, Signal("Pa", "master-cylinder pressure", 2e6), Ge(0)]


class Input(NamedTuple):
    """Piston travel and speed, flow into the pipeline."""

    x: Annotated[float, Signal("m", "piston travel", 7e-3)]
    v: Annotated[float, Signal("m/s", "piston speed", 0.02)]
    q: Annotated[float, Signal("m**3/s", "flow out of the chamber", 1e-6)]


class InputRate(NamedTuple):
    """Derivatives of the inputs that affect the stored energy."""

    x: Annotated[float, Signal("m/s", "piston speed", 0.02)]


class Output(NamedTuple):
    """Load of the piston on the drive, against clamping."""

    force: Annotated[float, Signal("N", "piston load", 200.0)]


def volume(u: Input, par: Parameters) -> Annotated[float, Signal("m**3", "volume", 3e-7)]:
    """Return the fluid volume of the chamber, V_mc = A_mc (s_mc - x_mc)."""
    return par.A_mc * (par.s_mc - u.x)


def mass(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> FluidCompliance:
    """Return the factor of dp/dt, the compliance of the enclosed fluid."""
    return brake_fluid.compliance(brake_fluid.Chamber(V=volume(u, par), p=x.p), fluid)


def balance(u: Input, par: Parameters) -> Annotated[float, Signal("m**3/s", "flow", 1e-6)]:
    r"""Return the flow that compresses the chamber.

    .. math:: \frac{V_{mc}}{\beta} \frac{dp_{mc}}{dt} = A_{mc} v_{mc} - q_{mc}

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (9).
    """
    return par.A_mc * u.v - u.q


def output(x: State, u: Input, par: Parameters) -> Output:
    """Return the piston load, which is pressure and damping force of eq. (4), without friction."""
    return Output(force=x.p * par.A_mc + par.k_damp * u.v)


def input_rate(u: Input) -> InputRate:
    """Return the rate of the travel, because the chamber volume is a port and not a state."""
    return InputRate(x=u.v)


def energy(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    """Return the compression energy of the fluid and its gas."""
    return brake_fluid.compression_energy(brake_fluid.Chamber(V=volume(u, par), p=x.p), fluid)


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the piston power minus the outflow power."""
    return output(x, u, par).force * u.v - brake_fluid.convected_power(u.q, x.p, fluid)


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the heat from the damping force, >= 0."""
    return par.k_damp * u.v * u.v


@within_limits
def watch(t: Array, x: State, fluid: brake_fluid.Parameters) -> list[str]:
    """Warn if the absolute pressure is below zero."""
    return brake_fluid.watch(t, x.p, fluid, "in the master cylinder")
