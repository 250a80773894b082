r"""Pistons and springs of a tandem master cylinder, which feeds two separate circuits.

The push rod moves piston 1. Its chamber pushes the floating piston 2, which has a chamber of its
own. A complete master cylinder consists of this element and, for each of the two chambers, of a
`master_cylinder` (the pressure), a `reservoir_port`, a `cup_seal` (a friction on ``v_1`` or
``v_2``) and an `end_stop`. Chamber 1 and its stops have the travel :math:`x_1 - x_2`, and chamber 2
has the travel :math:`x_2`:

.. math::
    p_1 A = F - F_{s1} \mp F_{f1}, \quad p_1 A + F_{s1} = p_2 A + F_{s2} \pm F_{f2}

at rest, with the upper signs while the pistons move in. If a circuit has lost its fluid, the stops
carry the force: piston 1 runs to piston 2, or piston 2 to the end of the bore.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force, Mass, Unit
from bywire.core.signals import Energy, Power, Signal

SpringRate = Annotated[float, Unit("N/m", 1e3), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Rigid pistons. The spring between them is caged, so that its preload moves no piston."""

    m_1: Mass
    """mass of piston 1 and its push rod"""
    m_2: Mass
    """mass of the floating piston"""
    F_s1: Force
    """preload of the spring between the pistons"""
    k_s1: SpringRate
    """stiffness of the spring between the pistons"""
    F_s2: Force
    """preload of the spring behind the floating piston"""
    k_s2: SpringRate
    """stiffness of the spring behind the floating piston"""


FAULTS = (
    ParameterFault(
        "spring-1", "weaker spring between the pistons (value: factor)", ("F_s1", "k_s1"), 0.1
    ),
    ParameterFault(
        "spring-2",
        "weaker spring behind the floating piston (value: factor)",
        ("F_s2", "k_s2"),
        0.1,
    ),
)


class State(NamedTuple):
    """Travel and speed of both pistons from their retracted ends."""

    x_1: Annotated[float, Signal("m", "travel of piston 1", 0.01)]
    v_1: Annotated[float, Signal("m/s", "speed of piston 1", 0.1)]
    x_2: Annotated[float, Signal("m", "travel of piston 2", 0.01)]
    v_2: Annotated[float, Signal("m/s", "speed of piston 2", 0.1)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    x_1: Annotated[float, Signal("1", "unity")]
    v_1: Annotated[float, Signal("kg", "mass", 0.1)]
    x_2: Annotated[float, Signal("1", "unity")]
    v_2: Annotated[float, Signal("kg", "mass", 0.1)]


class Balance(NamedTuple):
    """Right-hand sides of the states."""

    x_1: Annotated[float, Signal("m/s", "speed of piston 1", 0.1)]
    v_1: Annotated[float, Signal("N", "force on piston 1", 1e3)]
    x_2: Annotated[float, Signal("m/s", "speed of piston 2", 0.1)]
    v_2: Annotated[float, Signal("N", "force on piston 2", 1e3)]


class Input(NamedTuple):
    """Force of the push rod, and loads of both chambers including their stops."""

    F: Annotated[float, Signal("N", "force of the push rod", 1e3)]
    load_1: Annotated[float, Signal("N", "load between the pistons", 1e3)]
    load_2: Annotated[float, Signal("N", "load on the floating piston", 1e3)]


class Output(NamedTuple):
    """Travels and speeds of both chambers, and the springs' forces."""

    x_c1: Annotated[float, Signal("m", "travel of chamber 1", 0.01)]
    v_c1: Annotated[float, Signal("m/s", "speed of chamber 1", 0.1)]
    F_spring_1: Annotated[float, Signal("N", "force of the spring between the pistons", 100.0)]
    F_spring_2: Annotated[float, Signal("N", "force of the spring behind piston 2", 100.0)]


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the masses."""
    return Factors(x_1=1.0, v_1=par.m_1, x_2=1.0, v_2=par.m_2)


def output(x: State, par: Parameters) -> Output:
    r"""Return travel and speed of chamber 1, and the springs' forces.

    .. math:: S_1 = F_{s1} + k_{s1} (x_1 - x_2), \quad S_2 = F_{s2} + k_{s2} x_2
    """
    travel = x.x_1 - x.x_2
    return Output(
        x_c1=travel,
        v_c1=x.v_1 - x.v_2,
        F_spring_1=par.F_s1 + par.k_s1 * travel,
        F_spring_2=par.F_s2 + par.k_s2 * x.x_2,
    )


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speeds and forces without friction.

    .. math::
        m_1 \dot v_1 = F - L_1 - S_1, \quad m_2 \dot v_2 = L_1 + S_1 - L_2 - S_2
    """
    y = output(x, par)
    return Balance(
        x_1=x.v_1,
        v_1=u.F - u.load_1 - y.F_spring_1,
        x_2=x.v_2,
        v_2=u.load_1 + y.F_spring_1 - u.load_2 - y.F_spring_2,
    )


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy, and that of the springs relative to their preload."""
    travel = x.x_1 - x.x_2
    springs = (par.F_s1 + 0.5 * par.k_s1 * travel) * travel
    springs = springs + (par.F_s2 + 0.5 * par.k_s2 * x.x_2) * x.x_2
    return springs + 0.5 * (par.m_1 * x.v_1 * x.v_1 + par.m_2 * x.v_2 * x.v_2)


def power_in(x: State, u: Input) -> Power:
    """Return the power of the push rod, minus that of the chambers and stops."""
    return u.F * x.v_1 - u.load_1 * (x.v_1 - x.v_2) - u.load_2 * x.v_2
