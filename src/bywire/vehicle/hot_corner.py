"""A car's corner whose brake warms up and fades.

A corner inherits from `HotCorner` in place of `Corner`, has parameters ``corner.heat``, lets the
friction of its pads follow `pads_friction`, and says in ``brake_torque`` what its brake can hold.
"""

from __future__ import annotations

from typing import Self

from bywire.core import ops
from bywire.core.assembly import MemoryT, ParT
from bywire.core.parts import Part, Shown
from bywire.core.signals import Role
from bywire.plant import disc_heat
from bywire.vehicle.corner import Corner, CornerParameters
from bywire.vehicle.two_wheeler import BOOK

_BOOK = "heat"


class HotCornerParameters(CornerParameters):
    """A corner whose brake may warm up."""

    heat: disc_heat.Parameters


def _sink(label: str) -> Role:
    return Role("sink", label, book=_BOOK, returns="any")


class HotCorner(Corner[ParT, MemoryT]):
    """Friction heats the disc, and the pads rub as they can at that heat."""

    disc_heat = Part(
        disc_heat, par="corner.heat", fixed=disc_heat.State._fields, outside=True, loss="E_air"
    )

    E_friction = Shown(
        "J", "friction of the brake that warms up", role=Role("source", "brake", book=_BOOK)
    )
    E_discs = Shown("J", "heat in the disc", role=_sink("disc"))
    E_pads = Shown("J", "heat in the pads", role=_sink("pads"))
    E_fluid = Shown("J", "heat in the caliper", role=_sink("caliper"))
    E_brake = Shown(
        "J",
        "energy that the brake takes from the wheel",
        role=Role("sink", "brake", book=BOOK, returns="any"),
    )

    def braked(self, w: Self) -> float:
        """Return what the brake has taken from the wheel [J]."""
        raise NotImplementedError

    def brake_torque(self, w: Self) -> float:
        """Return what the brake can hold at the wheel [N m], >= 0."""
        raise NotImplementedError

    def pads_friction(self, w: Self) -> float:
        """Return the friction of the pads over that of cold ones."""
        return disc_heat.friction(w.disc_heat.xe.T_disc, w.disc_heat.par)

    def wire(self, w: Self) -> None:
        """Say what warms the brake: limit of the friction times speed, 0 where the wheel stands."""
        super().wire(w)
        torque = self.brake_torque(w)
        w.disc_heat.u = disc_heat.Input(
            P=torque * ops.fabs(self.wheel(w).x),
            v=w.corner.xe.v,
            pressed=ops.where(torque > 0, 1.0, 0.0),
        )

    def record(self, w: Self) -> dict[str, float]:
        """Return the heat that the bodies hold, and where it came from."""
        heat = disc_heat.stored(w.disc_heat.x, w.disc_heat.par)
        return {
            **super().record(w),
            "E_friction": 0.0 if w.disc_heat.par.law == "off" else self.braked(w),
            "E_brake": self.braked(w),
            "E_discs": heat.discs,
            "E_pads": heat.pads,
            "E_fluid": heat.fluid,
        }


def warm_disc(T: float, par: disc_heat.Parameters) -> disc_heat.State:
    """Return the brake with its disc at a temperature [K], the rest as warm as the air."""
    return disc_heat.State(T, par.T_a, par.T_a)
