"""A car's corner with the wedge brake: its disc turns with a wheel on the road.

At the end of a stop the tyre rocks back and the wheel would turn with it: what the pads do to the
wedge then changes its sign, and self-reinforcement becomes release.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

from bywire.brakes.wedge import control
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.start import memory_at
from bywire.core.parts import Shown
from bywire.core.signals import Role
from bywire.plant import flywheel
from bywire.vehicle.corner import Corner, CornerParameters, WheelSpeed, rolling_states
from bywire.vehicle.two_wheeler import BOOK


class WedgeCornerParameters(WedgeParameters):
    """The wedge brake, its flywheel for a wheel, and a quarter of a car."""

    corner: CornerParameters


class WedgeCorner(Corner[WedgeCornerParameters, control.Memory], WedgeBrake):
    """The brake with all its controllers; the flywheel is the wheel, the road turns it."""

    name: ClassVar[str] = "wedge-corner"
    Memory: ClassVar = control.Memory
    Stimulus: ClassVar = control.Stimulus

    E_wheel = Shown("J", "energy of the wheel", role=Role("sink", "wheel", book=BOOK))
    E_brake = Shown(
        "J", "energy that the brake takes from the wheel", role=Role("sink", "brake", book=BOOK)
    )

    records: ClassVar[tuple[str, ...]] = (
        "s", "v_x", "v_tread", "a", "slip", "sliding", "u", "F_x", "N_x", "t_locked", "E_body",
        "E_wheel", "E_tyre", "E_brake", "W_slope", *WedgeBrake.records,
    )  # fmt: skip

    def wheel(self, w: Self) -> WheelSpeed:
        """Return how fast the disc turns, and the wheel with it."""
        return WheelSpeed(w.disc.x.Omega, w.disc.xe.Omega)

    def disc_torque(self, w: Self) -> float:
        """Return the torque of the road."""
        return self.tyre_torque(w)

    def record(self, w: Self) -> dict[str, float]:
        """Return what is recorded beside states, wires and losses."""
        return {
            **super().record(w),
            "E_wheel": flywheel.energy(w.disc.x, w.disc.par),
            "E_brake": w.flow.W_brake,
        }

    def rest(self, par: Any) -> tuple[Any, control.Memory]:
        """Return the vehicle standing, the brake parked."""
        return at_speed(0.0, par)


def at_speed(v: float, par: WedgeCornerParameters) -> tuple[Any, control.Memory]:
    """Return the corner rolling at a speed [m/s], its brake parked."""
    brake = state_at(0.0, par)._asdict() | {"Omega": v / par.corner.r}
    rolling = WedgeCorner.state(**rolling_states(v))._asdict()
    return WedgeCorner.State(**(rolling | brake)), memory_at(0.0, par)
