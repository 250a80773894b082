"""A quarter car with the wedge brake, whose disc turns with a wheel on the road.

At the end of a stop, the tire rocks back and the wheel tends to turn with it. The pad friction on
the wedge then changes sign, and self-reinforcement turns into release.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

from bywire.brakes.wedge import control
from bywire.brakes.wedge.elements import wedge_caliper
from bywire.brakes.wedge.laws import moment_control
from bywire.brakes.wedge.model import WedgeBrake, memory_at, readings, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parts import Shown
from bywire.core.signals import Role, joined
from bywire.plant import flywheel, road, wheel_encoder
from bywire.vehicle import slip_control
from bywire.vehicle.corner import (
    HotCorner,
    HotCornerParameters,
    WheelSpeed,
    rolling_states,
    warm_disc,
)
from bywire.vehicle.slip_control import far_from_peak
from bywire.vehicle.two_wheeler import BOOK


class WedgeCornerParameters(WedgeParameters):
    """The wedge brake, its flywheel as the wheel, and a quarter car."""

    corner: HotCornerParameters
    ecu: slip_control.Parameters


Memory: Any = joined(__name__, "Memory", control.Memory, slip_control.Memory)
"""memory of moment, position and slip control"""


class WedgeCorner(HotCorner[WedgeCornerParameters, Any], WedgeBrake):
    """The brake with all its controllers. The flywheel is the wheel, which the road drives.

    Slip control works above the moment control and reduces the demanded moment. Fading pads
    reinforce the wedge less, so the motors have to compensate.
    """

    name: ClassVar[str] = "wedge-corner"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = control.Stimulus

    E_wheel = Shown(
        "J", "energy of the wheel", role=Role("sink", "wheel", book=BOOK, returns="any")
    )

    records: ClassVar[tuple[str, ...]] = (
        "s",
        "v_x",
        "v_tread",
        "a",
        "slip",
        "sliding",
        "u",
        "F_x",
        "N_x",
        "t_locked",
        "E_body",
        "E_wheel",
        "E_tyre",
        "E_brake",
        "W_slope",
        "T_disc",
        "T_pads",
        "T_fluid",
        "E_friction",
        "E_discs",
        "E_pads",
        "E_fluid",
        "E_air",
        "M_most",
        "v_hat",
        "slip_hat",
        "abs",
        "phase_x",
        *WedgeBrake.records,
    )

    def wheel(self, w: Self) -> WheelSpeed:
        """Return the disc speed, which is the wheel speed."""
        return WheelSpeed(w.disc.x.Omega, w.disc.xe.Omega)

    def disc_torque(self, w: Self) -> float:
        """Return the road torque."""
        return self.tyre_torque(w)

    def braked(self, w: Self) -> float:
        """Return the energy that the pads took from the disc."""
        taken: float = w.flow.W_brake
        return taken

    def brake_torque(self, w: Self) -> float:
        """Return the maximum moment that the pads can hold."""
        return wedge_caliper.moment(w.caliper.f.F_N, w.body.par.mu_B, 1.0, w.caliper.par)

    def wire(self, w: Self) -> None:
        """Connect all parts. The pad friction follows the disc temperature."""
        w.body.vary(mu_B=w.body.par.mu_B * self.pads_friction(w))
        super().wire(w)

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {**super().record(w), "E_wheel": flywheel.energy(w.disc.x, w.disc.par)}

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the brake's controllers, with slip control above them if it can act."""
        brake = super().tasks(par)
        if par.ecu.abs == "off" or par.command.mode != "moment":
            return brake
        return (Task("slip", par.ecu.T_s, _slip), *brake)

    def demand(self, m: Any, u: control.Stimulus, par: Any) -> float:
        """Return the moment that the brake follows [N m]."""
        moment: float = u.M_set if par.ecu.abs == "off" else m.M_left
        return moment

    def _moment(self, x: Any, m: Any, u: control.Stimulus, par: Any) -> Any:
        left = u._replace(M_set=self.demand(m, u, par))
        return super()._moment(x, _contact_tracked(x, m, par), left, par)

    def remarks(self, recording: Any, par: Any) -> list[str]:
        """Return remarks on a slip far below the slip at maximum adhesion."""
        if par.ecu.abs != "pi":
            return []
        return far_from_peak(
            recording["s"].values,
            recording["abs"].values,
            par.ecu.slip.slip_set,
            "ecu.slip.slip_set",
            par.corner.tyre,
            par.corner.road,
        )

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return the vehicle at rest with a parked brake."""
        return at_speed(0.0, par)


def _slip(x: Any, m: Any, u: control.Stimulus, par: WedgeCornerParameters) -> Any:
    """Run slip control once."""
    edge = wheel_encoder.reading(
        wheel_encoder.State(x.phi), wheel_encoder.Input(x.Omega), par.ecu.encoder
    )
    sine = road.slope(x.s, par.corner.road).sine
    seen = slip_control.Readings(
        x.v_x,
        x.Omega * par.corner.r,
        edge.angle,
        edge.age,
        par.corner.body.g * sine,
        ops.where((m.mode - moment_control.MOMENT) ** 2 < 0.25, 1.0, 0.0),
    )
    return slip_control.tick(seen, m, u.M_set, par.ecu)


def _contact_tracked(x: Any, m: Any, par: WedgeCornerParameters) -> Any:
    """Return the memory with the contact angle from the measured moment, while the wheel turns.

    Once the wheel is at rest, the control estimates the moment from the angle and keeps the last
    contact angle. Otherwise an error in the assumed stiffness would make the motors push against
    a wedge at rest.
    """
    law, seen = par.control.moment, readings(x, par)
    measured = ops.where(seen.Omega < 0, -1.0, 1.0) * seen.M
    contact = m.direction * 0.5 * (seen.theta_1 + seen.theta_2) - measured / law.slope_hat
    turns = ops.where(ops.fabs(seen.Omega) < law.Omega_still, 0.0, 1.0)
    braked = ops.where((m.mode - moment_control.MOMENT) ** 2 < 0.25, turns, 0.0)
    return m._replace(theta_c=ops.where(braked > 0.5, contact, m.theta_c))


def at_speed(v: float, par: WedgeCornerParameters, T_disc: float | None = None) -> tuple[Any, Any]:
    """Return the corner rolling at a speed [m/s] with a parked brake.

    ``T_disc``: disc temperature [K]; default: the air temperature.
    """
    heat = par.corner.heat
    disc = warm_disc(heat.T_a if T_disc is None else T_disc, heat)
    brake = state_at(0.0, par)._asdict() | {"Omega": v / par.corner.r}
    rolling = WedgeCorner.state(**rolling_states(v), disc_heat=disc)._asdict()
    held = memory_at(0.0, par)._asdict() | slip_control.awake(v, par.ecu)
    return WedgeCorner.State(**(rolling | brake)), Memory(**held)
