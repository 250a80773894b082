"""A two-wheeler whose brakes warm up and fade.

A vehicle inherits from `HotBrakes` in place of `TwoWheeler`, has parameters ``front.heat`` and
``rear.heat``, and says in ``cold_torques`` what its brakes hold when cold. Each wheel's brake may
stay cold (``front.heat.law = "off"``): nothing is then computed of its heat.
"""

from __future__ import annotations

from typing import Any, Self

from bywire.core import ops
from bywire.core.assembly import MemoryT, ParT
from bywire.core.parts import Part, Shown
from bywire.core.signals import Role
from bywire.plant import disc_heat
from bywire.vehicle.two_wheeler import TwoWheeler

_BOOK = "heat"
_SLOW = disc_heat.State._fields


def _sink(label: str) -> Role:
    return Role("sink", label, book=_BOOK, returns="any")


class HotBrakes(TwoWheeler[ParT, MemoryT]):
    """Friction heats the discs of both wheels, and the pads hold what they can at that heat."""

    front_heat = Part(
        disc_heat, par="front.heat", suffix="_f", fixed=_SLOW, outside=True, loss="E_air"
    )
    rear_heat = Part(
        disc_heat, par="rear.heat", suffix="_r", fixed=_SLOW, outside=True, loss="E_air"
    )

    E_friction = Shown(
        "J", "friction of the brakes that warm up", role=Role("source", "brakes", book=_BOOK)
    )
    E_discs = Shown("J", "heat in the discs", role=_sink("discs"))
    E_pads = Shown("J", "heat in the pads", role=_sink("pads"))
    E_fluid = Shown("J", "heat in calipers and fluid", role=_sink("calipers and fluid"))

    def cold_torques(self, w: Self) -> tuple[float, float]:
        """Return what the front and the rear brake can hold when cold [N m], >= 0."""
        raise NotImplementedError

    def brake_torques(self, w: Self) -> tuple[float, float]:
        """Return what they can hold at the temperature of their discs."""
        front, rear = self.cold_torques(w)
        return (
            front * disc_heat.friction(w.front_heat.xe.T_disc, w.front_heat.par),
            rear * disc_heat.friction(w.rear_heat.xe.T_disc, w.rear_heat.par),
        )

    def wire(self, w: Self) -> None:
        """Say what warms the brakes: limit of the friction times speed, 0 where a wheel stands."""
        super().wire(w)
        for heat, wheel, torque in (
            (w.front_heat, w.front, w.T_f),
            (w.rear_heat, w.rear, w.T_r),
        ):
            heat.u = disc_heat.Input(
                P=torque * ops.fabs(wheel.x.omega),
                v=w.body.xe.v,
                pressed=ops.where(torque > 0, 1.0, 0.0),
            )

    def record(self, w: Self) -> dict[str, float]:
        """Return the heat that the bodies hold, and where it came from."""
        every = ((w.front_heat, w.flow.E_brake_f), (w.rear_heat, w.flow.E_brake_r))
        each = [disc_heat.stored(heat.x, heat.par) for heat, _ in every]
        return {
            **super().record(w),
            "E_friction": sum((taken for heat, taken in every if heat.par.law != "off"), start=0.0),
            "E_discs": each[0].discs + each[1].discs,
            "E_pads": each[0].pads + each[1].pads,
            "E_fluid": each[0].fluid + each[1].fluid,
        }


def cold_start(front: disc_heat.Parameters, rear: disc_heat.Parameters) -> dict[str, Any]:
    """Return the states of both brakes as warm as the air, by their parts."""
    return {
        part: disc_heat.State(par.T_a, par.T_a, par.T_a)
        for part, par in (("front_heat", front), ("rear_heat", rear))
    }
