r"""Piston of a return pump, driven by an eccentric, with suction and delivery check valves.

The pump of an anti-lock system sucks released fluid from the low-pressure accumulator and returns
it to the master cylinder. This element is one piston. A pump with n pistons is n parts with the
phases :math:`2 \pi k/n` on one shaft, one part per hydraulic circuit.

The chamber's pressure follows the open valve within microseconds, so it is not a state. The state
is the fluid in the chamber. If suction cannot fill the chamber, a void at vacuum remains, and the
next delivery stroke closes the void before fluid flows out. A starved pump therefore delivers
exactly what it has sucked, and does not create fluid (see ``docs/decisions/0038-starved-pump.md``).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Conductance, Length, Unit, Volume
from bywire.core.signals import Energy, Power, Pressure, Role, Signal
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.validity import highest, within_limits
from bywire.plant import brake_fluid, check_valve

Phase = Annotated[float, Unit("rad", 1.0), Field(allow_inf_nan=False)]
ClosingTime = Annotated[float, Unit("s", 5e-5), Field(gt=0, allow_inf_nan=False)]
PumpPressure = Annotated[float, Unit("Pa", 2.5e7), Field(gt=0, allow_inf_nan=False)]
Flow = Annotated[float, Signal("m**3/s", "flow", 1e-5)]
Loss = Annotated[float, Signal("W", "loss in the return pump", role=Role("sink", "return pump"))]
ROUNDING = 2e-2
"""share of the displacement over which a void begins smoothly, larger than the step's errors"""


NOTHING = 1e-12
"""share of the displacement that avoids a division of 0 by 0 at the dead centers"""


class Parameters(ParameterSet):
    """Massless piston that follows a rigid eccentric, without leakage past its seal."""

    d_p: Length
    """diameter of the piston"""
    e: Length
    """eccentricity, which is half the stroke"""
    phase: Phase
    """angle of the eccentric at a shaft angle of 0; at angle 0, the chamber is largest"""
    V_dead: Volume
    """minimum volume of the chamber"""
    V_gas: Volume
    """volume of gas bubbles in the chamber, at ambient pressure"""
    tau: ClosingTime
    """time constant with which a void closes, at least half the step"""
    suction: check_valve.Parameters
    """valve from the accumulator"""
    delivery: check_valve.Parameters
    """valve to the master cylinder"""
    G_back: Conductance
    """leak from delivery to suction, 0 for tight valves"""
    p_max: PumpPressure
    """highest permitted pressure, above which bywire warns"""


FAULTS = (
    ParameterFault("gassy", "more gas bubbles in the chamber (value: factor)", ("V_gas",), 50.0),
    ParameterFault("clogged", "narrower suction valve (value: factor)", ("suction.seat.d",), 0.2),
    ParameterFault(
        "stuck", "the piston hardly follows the eccentric (value: factor)", ("e",), 0.01
    ),
    ParameterFault(
        "leaking", "the valves leak (value: conductance)", replaced="G_back", value=1e-13
    ),
)


class State(NamedTuple):
    """Fluid in the chamber, minus the mean volume of the chamber."""

    V: Annotated[float, Signal("m**3", "fluid in the pump, relative to the mean", 3e-8)]


class Input(NamedTuple):
    """Shaft angle and speed, pressures at suction and delivery."""

    theta: Annotated[float, Signal("rad", "shaft angle", 3.0)]
    omega: Annotated[float, Signal("rad/s", "shaft speed", 300.0)]
    p_s: Annotated[float, Signal("Pa", "suction pressure", 2e5, low=-101_325.0)]
    p_d: Pressure


class InputRate(NamedTuple):
    """Derivative of the input that affects the stored energy."""

    theta: Annotated[float, Signal("rad/s", "shaft speed", 300.0)]


class Output(NamedTuple):
    """Flows, load of the shaft, its set-valued part, and void."""

    q_s: Annotated[float, Signal("m**3/s", "flow into the pump", 1e-5)]
    q_d: Annotated[float, Signal("m**3/s", "flow out of the pump", 1e-5)]
    torque: Annotated[float, Signal("N*m", "mean load of the pump", 0.1)]
    friction: Annotated[float, Signal("N*m", "set-valued load of the pump", 0.1)]
    void: Annotated[float, Signal("m**3", "void in the pump", 3e-8)]


def area(par: Parameters) -> Annotated[float, Signal("m**2", "area", 3e-5)]:
    r"""Return the area of the piston, :math:`A_p = \pi d_p^2 / 4`."""
    return 0.25 * math.pi * par.d_p * par.d_p


def displacement(par: Parameters) -> Annotated[float, Signal("m**3", "volume", 7e-8)]:
    r"""Return the volume per revolution, :math:`2 A_p e`."""
    return 2.0 * area(par) * par.e


class Void(NamedTuple):
    """Volume without fluid, and its derivative by the volume of the chamber."""

    V: Annotated[float, Signal("m**3", "void in the pump", 3e-8)]
    slope: Annotated[float, Signal("1", "slope of the void", 1.0)]


def void(x: State, u: Input, par: Parameters) -> Void:
    r"""Return the volume that fluid does not fill, :math:`\max(A_p e \cos\varphi - V, 0)`.

    The corner is rounded over 2 % of the displacement.
    """
    width = ROUNDING * displacement(par)
    empty = area(par) * par.e * ops.cos(u.theta + par.phase) - x.V
    inside = ops.clip(empty, 0.0, width)
    return Void(V=inside / width * (empty - 0.5 * inside), slope=inside / width)


def growth(u: Input, par: Parameters) -> Flow:
    r"""Return the rate of the chamber's volume, :math:`\dot V_c = -A_p e\, \omega \sin\varphi`."""
    return -1.0 * area(par) * par.e * ops.sin(u.theta + par.phase) * u.omega


def returned(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Flow:
    r"""Return the mean flow back from delivery to suction.

    .. math::
        q_r = G_{back} (p_d - p_s) + \frac{|\omega|}{2 \pi} \min\left(
        V_{gas} \frac{p_d}{p_{atm} + p_d} + \frac{V_{dead}}{\beta} p_d,\; 2 A_p e\right)

    The second term is the volume by which gas and fluid expand again after each delivery. At
    delivery pressures below 0 it is 0, and at rest it has a kink.
    """
    p = ops.fmax(u.p_d, 0.0)
    expands = par.V_gas * p / (fluid.p_atm + p) + par.V_dead * p / fluid.beta
    lost = ops.fmin(expands, displacement(par)) * ops.fabs(u.omega) / (2.0 * math.pi)
    return par.G_back * (u.p_d - u.p_s) + lost


class _Flows(NamedTuple):
    """Flows through the two valves, both >= 0."""

    suction: Flow
    delivery: Flow


def _flows(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> _Flows:
    most = check_valve.flow(check_valve.Input(u.p_s, -1.0 * fluid.p_atm), par.suction, fluid)
    through = growth(u, par) + void(x, u, par).V / par.tau
    return _Flows(
        suction=ops.fmin(ops.fmax(through, 0.0), most), delivery=ops.fmax(-1.0 * through, 0.0)
    )


def output(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Output:
    r"""Return flows and load.

    .. math::
        q_s = \min(\max(y, 0), q_{most}), \quad q_d = \max(-y, 0), \quad
        y = \dot V_c + V_{void}/\tau

    with the growth of the chamber and the largest flow into vacuum,
    :math:`q_{most} = q_{check}(p_s, -p_{atm})`. The flow back (`returned`) reduces both flows.

    While the chamber shrinks, the piston carries the flow energy (`brake_fluid.flow_energy`) of
    :math:`p_d` plus the pressure drop of the valve, and while it grows, that of :math:`p_s` minus
    the pressure drop. Half the sum of both pressures, :math:`p_\Sigma`, is a load that does not
    depend on the direction. Half the difference, :math:`p_\Delta`, always opposes the motion:

    .. math:: T = A_p e\, p_\Sigma \sin\varphi, \quad F = A_p e\, p_\Delta |\sin\varphi|

    Declare F as a friction on the shaft, with the bounds :math:`\pm F`. At rest, both valves are
    closed, and the chamber's pressure has any value between the two. A void reduces both pressures
    toward vacuum, :math:`p \to p - (1 - \sigma)(p + p_{atm})`, with
    :math:`\sigma = \tau |\dot V_c| / (\tau |\dot V_c| + V_{void})`.

    Notes
    -----
    The flows have kinks where a valve opens, and where suction reaches its largest flow. The load
    has kinks at the dead centers. If the suction pressure exceeds the delivery pressure, fluid
    could flow through a resting pump. Use another `check_valve` for this.
    """
    s, flows = growth(u, par), _flows(x, u, par, fluid)
    vacuum, h = -1.0 * fluid.p_atm, brake_fluid.flow_energy
    empty = void(x, u, par)
    before = h(u.p_s, fluid) - check_valve.pressure_drop(flows.suction, par.suction, fluid)
    behind = h(u.p_d, fluid) + check_valve.pressure_drop(flows.delivery, par.delivery, fluid)
    swept = par.tau * ops.fabs(s)
    solid = swept / ops.fmax(swept + empty.V, NOTHING * displacement(par))
    grown = (1.0 - solid) * empty.slope
    before = ops.fmax(before, vacuum)
    before = before + grown * (vacuum - before)
    behind = behind + grown * (vacuum - behind)
    arm = area(par) * par.e * ops.sin(u.theta + par.phase)
    back = returned(u, par, fluid)
    return Output(
        q_s=flows.suction - back,
        q_d=flows.delivery - back,
        torque=0.5 * arm * (behind + before),
        friction=0.5 * ops.fabs(arm) * ops.fmax(behind - before, 0.0),
        void=empty.V,
    )


def mass(x: State) -> Annotated[float, Signal("1", "unity")]:
    """Return the factor of the volume's derivative, 1."""
    return 1.0


def balance(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Flow:
    r"""Return the net inflow, :math:`\dot V = q_s - q_d`."""
    flows = _flows(x, u, par, fluid)
    return flows.suction - flows.delivery


def input_rate(u: Input) -> InputRate:
    """Return the speed, because the chamber volume is a port and not a state."""
    return InputRate(theta=u.omega)


def energy(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    """Return the work of the void against ambient pressure."""
    return fluid.p_atm * void(x, u, par).V


def shaft_power(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of the shaft, including that against the set-valued load."""
    y = output(x, u, par, fluid)
    return y.torque * u.omega + y.friction * ops.fabs(u.omega)


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of shaft and inflow, minus that of the outflow."""
    y, convected = output(x, u, par, fluid), brake_fluid.convected_power
    flows = convected(y.q_s, u.p_s, fluid) - convected(y.q_d, u.p_d, fluid)
    return shaft_power(x, u, par, fluid) + flows


def power_loss(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Loss:
    """Return the heat from valves, returned flow and closing voids, >= 0.

    Notes
    -----
    It contains the power of the set-valued load, ``F * |omega|``. In an assembly, the actual power
    is that of the reaction on the shaft. To balance the energy exactly, add the difference,
    ``-reaction * omega - F * |omega|``, to the loss of the part.
    """
    opens = growth(u, par) - balance(x, u, par, fluid)
    return power_in(x, u, par, fluid) - fluid.p_atm * void(x, u, par).slope * opens


@within_limits
def watch(t: Array, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> list[str]:
    """Warn if the delivery pressure exceeds the permitted one, or suction is below vacuum."""
    texts = brake_fluid.watch(t, u.p_s, fluid, "at the pump's suction")
    p = highest(u.p_d)
    if p > par.p_max:
        limit = shown(par.p_max, "Pa")
        texts.append(f"the return pump works against {shown(p, 'Pa')}, above p_max = {limit}")
    return texts
