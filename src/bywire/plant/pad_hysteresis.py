r"""Hysteresis of pads and caliper: slipping springs parallel to the elastic curve (Maxwell slip).

Four springs follow the compression and slip at their slip forces, so their force depends on the
compression's reversals, and not on its speed. Together with the elastic curve f,

.. math:: F = f(n) + \sum_j k_j z_j, \quad dz_j = dn, \quad |z_j| \le W_j/k_j

On virgin loading, the springs add their forces up to :math:`\sum_j W_j`. A cycle of amplitude a
loses :math:`4 \sum_j W_j (a - W_j/k_j)^+`. A spring with a slip force of zero has no effect.

The deflections are stop operators (see ``docs/modeling.md``). The force of a spring has a corner
where it begins to slip, and where the motion reverses while it slips. A linear model contains the
stiffness of a spring that is not at its slip force. At the slip force, it requires a side. With law
"load", the slip forces also have a corner at zero load, below which they are zero.

References
----------
F. Al-Bender, V. Lampaert, J. Swevers, Chaos 14(2), 2004, doi:10.1063/1.1741752 (abstract): the
generalized Maxwell-slip model, which also describes how friction depends on the sliding speed.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force, Stiffness, Unit
from bywire.core.signals import Energy, Role, Signal

Load = Annotated[float, Unit("N", 1e4), Field(gt=0, allow_inf_nan=False)]
Work = Annotated[float, Signal("W", "work on the springs that slip")]
Loss = Annotated[
    float, Signal("W", "loss in the pads' hysteresis", role=Role("sink", "pad hysteresis"))
]


class Parameters(ParameterSet):
    """Stiffnesses and slip forces of the springs.

    ``law``: ``"constant"`` slip forces; ``"load"``: slip forces in proportion to the load;
    ``"off"``: no hysteresis.
    """

    law: Literal["off", "constant", "load"]
    """dependence of the slip forces on the load"""
    k_1: Stiffness
    """stiffness of the first spring"""
    k_2: Stiffness
    """stiffness of the second spring"""
    k_3: Stiffness
    """stiffness of the third spring"""
    k_4: Stiffness
    """stiffness of the fourth spring"""
    W_1: Force
    """slip force of the first spring"""
    W_2: Force
    """slip force of the second spring"""
    W_3: Force
    """slip force of the third spring"""
    W_4: Force
    """slip force of the fourth spring"""
    F_ref: Load
    """load at which the slip forces have these values (law "load")"""


FAULTS = (
    ParameterFault(
        "loose",
        "the pads' layers slip more easily (value: factor)",
        ("W_1", "W_2", "W_3", "W_4"),
        0.5,
    ),
    ParameterFault(
        "rough", "the pads' layers slip harder (value: factor)", ("W_1", "W_2", "W_3", "W_4"), 2.0
    ),
)


class State(NamedTuple):
    """Deflections, positive for a spring that pushes back."""

    z_1: Annotated[float, Signal("m", "deflection of the first spring", 1e-4)]
    z_2: Annotated[float, Signal("m", "deflection of the second spring", 1e-4)]
    z_3: Annotated[float, Signal("m", "deflection of the third spring", 1e-4)]
    z_4: Annotated[float, Signal("m", "deflection of the fourth spring", 1e-4)]


class Input(NamedTuple):
    """Speed of the compression, and the load that presses the layers together."""

    v: Annotated[float, Signal("m/s", "speed of compression", 0.01)]
    load: Annotated[float, Signal("N", "load", 1e4)]


class Speeds(NamedTuple):
    """Speeds of the springs' ends, or slip speeds."""

    z_1: Annotated[float, Signal("m/s", "speed of the first spring", 0.01)]
    z_2: Annotated[float, Signal("m/s", "speed of the second spring", 0.01)]
    z_3: Annotated[float, Signal("m/s", "speed of the third spring", 0.01)]
    z_4: Annotated[float, Signal("m/s", "speed of the fourth spring", 0.01)]


class Output(NamedTuple):
    """Force."""

    F_hysteresis: Annotated[float, Signal("N", "force of the pads' hysteresis", 1e3)]


def _slip_forces(u: Input, par: Parameters) -> tuple[float, ...]:
    """Return the slip forces at a load."""
    forces = (par.W_1, par.W_2, par.W_3, par.W_4)
    if par.law == "off":
        return (0.0 * par.W_1,) * 4
    if par.law == "constant":
        return forces
    share = ops.fmax(u.load, 0.0) / par.F_ref
    return tuple(W * share for W in forces)


def rate(u: Input) -> Speeds:
    """Return the speed of compression, which every spring follows."""
    return Speeds(u.v, u.v, u.v, u.v)


def slip_width(u: Input, par: Parameters) -> State:
    """Return the deflections at which the springs slip, W/k."""
    W_1, W_2, W_3, W_4 = _slip_forces(u, par)
    return State(W_1 / par.k_1, W_2 / par.k_2, W_3 / par.k_3, W_4 / par.k_4)


def output(x: State, par: Parameters) -> Output:
    """Return the force against the compression, in addition to that of the elastic curve."""
    return Output(par.k_1 * x.z_1 + par.k_2 * x.z_2 + par.k_3 * x.z_3 + par.k_4 * x.z_4)


def energy(x: State, par: Parameters) -> Energy:
    """Return the energy of the springs."""
    return 0.5 * (
        par.k_1 * x.z_1 * x.z_1
        + par.k_2 * x.z_2 * x.z_2
        + par.k_3 * x.z_3 * x.z_3
        + par.k_4 * x.z_4 * x.z_4
    )


def power_in(x: State, u: Input, par: Parameters) -> Work:
    """Return the power with which the motion loads the springs."""
    return output(x, par).F_hysteresis * u.v


def power_loss(u: Input, slip: Speeds, par: Parameters) -> Loss:
    """Return the loss of the slipping springs, their slip force times the slip speed, >= 0."""
    W_1, W_2, W_3, W_4 = _slip_forces(u, par)
    return (
        W_1 * ops.fabs(slip.z_1)
        + W_2 * ops.fabs(slip.z_2)
        + W_3 * ops.fabs(slip.z_3)
        + W_4 * ops.fabs(slip.z_4)
    )
