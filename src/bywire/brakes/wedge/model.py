"""The wedge brake: two motors, screws, brake heart, wedge, caliper, disc, and its controllers.

Source: R. Roberts, M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the
Mechatronic Wedge Brake", SAE, 2003.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

from bywire.brakes.wedge import control, drive_train
from bywire.brakes.wedge.control import Memory
from bywire.brakes.wedge.elements import brake_heart, wedge, wedge_caliper, wedge_friction
from bywire.brakes.wedge.laws import screw_offset
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.watch import warnings_of
from bywire.core import ops
from bywire.core.assembly import Assembly
from bywire.core.model import Bounds, Task
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.signals import Role, zeros
from bywire.plant import (
    clearance_adjuster,
    current_drive,
    drive_supply,
    end_stop,
    flywheel,
    moment_sensor,
    motor_heat,
    roller_screw,
    servo_motor,
    shaft_encoder,
)

Par = WedgeParameters
LOSSES = {"E_copper": "copper_loss", "E_damping": "damping_loss"}
"""energies lost in both motors together"""
_SLOW = motor_heat.State._fields
_SUPPLY = Role(
    "source", "supply", whole="W_electric", rest="E_standby", rest_label="standby of the drives"
)
_DISC = Role(
    "source",
    "disc",
    whole="W_disc",
    rest="E_pads",
    rest_label="heat of pads and disc",
    book="with disc",
)


class WedgeBrake(Assembly[WedgeParameters, control.Memory]):
    """Model of the brake.

    It has four dry frictions: two shafts (bearings and screw), the wedge, and the pads on the disc.
    It has six contacts: three coupled contacts in the heart, the caliper, and the wedge's two end
    stops.
    """

    name: ClassVar[str] = "wedge-brake"
    Memory: ClassVar = control.Memory
    Stimulus: ClassVar = control.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega_1", "omega_2", "v", "Omega")

    W_supply = Integral("J", "energy at the drives' input, including standby", role=_SUPPLY)
    W_electric = Integral(
        "J", "electrical energy into the motors", role=Role("source", "electrical")
    )
    W_disc = Integral("J", "work of the disc on the wedge", role=Role("source", "disc on wedge"))
    W_runout = Integral("J", "work of the runout on the caliper", role=Role("source", "run-out"))
    W_adjuster = Integral(
        "J", "work of the adjuster on the caliper", role=Role("source", "adjuster")
    )
    W_brake = Integral("J", "energy taken from the disc", role=_DISC)
    drive_1 = Part(current_drive, par="drive", suffix="_1")
    motor_1 = Part(servo_motor, suffix="_1", fixed=("theta",), loss=LOSSES)
    drive_2 = Part(current_drive, par="drive", suffix="_2")
    motor_2 = Part(servo_motor, suffix="_2", fixed=("theta",), loss=LOSSES)
    E_shaft = Integral(
        "J", "friction of bearings and screws", role=Role("sink", "bearings and screws")
    )
    E_wedge = Integral("J", "friction on the wedge", role=Role("sink", "friction on the wedge"))
    heart = Part(brake_heart, output=("f_1", "f_2", "f_12", "F_M"), work="W_heart", loss="E_heart")
    body = Part(wedge, par="wedge")
    caliper = Part(wedge_caliper, output=("F_N",), work="W_caliper", loss="E_caliper")
    adjuster = Part(clearance_adjuster)
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    t_stuck = Integral("s", "time during which shafts and wedge stick", role=Role("standstill"))
    disc = Part(flywheel, par="flywheel", outside=True)
    moment_sensor = Part(moment_sensor, state={"M": "y_M"})
    supply = Part(drive_supply, state={"P": "y_P"})
    heat_1 = Part(
        motor_heat, par="motor_heat", suffix="_1", fixed=_SLOW, outside=True, loss="E_motor_air"
    )
    heat_2 = Part(
        motor_heat, par="motor_heat", suffix="_2", fixed=_SLOW, outside=True, loss="E_motor_air"
    )

    F_1 = Wire("N", "axial force on screw 1", 400.0)
    F_2 = Wire("N", "axial force on screw 2", 400.0)
    squeeze = Wire("N", "sum of the forces on the wedge", 800.0)
    turning = Wire("1", "disc direction")
    M_B = Wire("N*m", "braking moment", 300.0)
    voltage_1 = Shown("V", "motor voltage 1", 10.0)
    voltage_2 = Shown("V", "motor voltage 2", 10.0)
    F_end = Shown("N", "force on the end stops", 100.0)
    T_fr_1 = Shown("N*m", "friction torque 1", 0.1)
    T_fr_2 = Shown("N*m", "friction torque 2", 0.1)
    F_fr = Shown("N", "friction on the wedge", 50.0)
    contacts = Shown("1", "closed contacts in the brake heart, as a sum of 1, 2 and 4", 4.0)
    stuck = Shown("1", "shafts and wedge stuck")
    P_in = Shown("W", "power at the drives' input", 50.0)
    P_meas = Shown("W", "power at the drives' input, filtered", 50.0)
    E_source = Shown("J", "energy input: electrical, disc on wedge, runout")
    U_caliper = Shown("J", "energy stored in the caliper")
    clearance = Shown("m", "total clearance of both pads, wedge centered", 2e-4)
    E_warming = Shown("J", "copper loss that warms the motors", role=motor_heat.COPPER)
    E_winding = Shown("J", "heat in the motor windings", role=motor_heat.WINDING)
    E_housing = Shown("J", "heat in the motor housings", role=motor_heat.HOUSING)

    records: ClassVar[tuple[str, ...]] = (
        "M_set",
        "M_B",
        "y_M",
        "M_meas",
        "mode",
        "rate",
        "sat_rate",
        "theta_c",
        "theta_ref",
        "theta_1_ref",
        "theta_2_ref",
        "theta_1",
        "theta_2",
        "omega_1",
        "omega_2",
        "i_1_ref",
        "i_2_ref",
        "i_1",
        "i_2",
        "voltage_1",
        "voltage_2",
        "x",
        "v",
        "f_1",
        "f_2",
        "f_12",
        "F_M",
        "F_N",
        "F_end",
        "T_fr_1",
        "T_fr_2",
        "F_fr",
        "Omega",
        "phi",
        "contacts",
        "stuck",
        "P_in",
        "P_meas",
        "E_source",
        "E_copper",
        "E_damping",
        "E_shaft",
        "E_wedge",
        "E_heart",
        "E_caliper",
        "E_stop",
        "E_stored",
        "U_caliper",
        "W_supply",
        "W_electric",
        "W_disc",
        "W_runout",
        "W_adjuster",
        "W_brake",
        "t_stuck",
        "clearance",
        "taken",
        "clicks",
        "teeth",
        "gap_hat",
        "adjusting",
        "T_winding_1",
        "T_winding_2",
        "T_housing_1",
        "T_housing_2",
        "derated",
        "E_warming",
        "E_winding",
        "E_housing",
        "E_motor_air",
    )

    def wire(self, w: Self) -> None:
        """Connect all parts: contact forces, shafts, wedge, disc, measurements."""
        par, forces = w.par, brake_heart.output(w.heart.f)
        w.F_1, w.F_2, w.squeeze = forces.F_1, forces.F_2, forces.squeeze
        w.turning = flywheel.turning(w.disc.xe, par.flywheel)
        w.M_B = wedge_caliper.moment(w.caliper.f.F_N, w.body.par.mu_B, w.turning, par.caliper)
        for drive, motor, heat, i_ref, force in (
            (w.drive_1, w.motor_1, w.heat_1, w.m.i_1_ref, w.F_1),
            (w.drive_2, w.motor_2, w.heat_2, w.m.i_2_ref, w.F_2),
        ):
            warm = motor_heat.warmth(heat.xe, heat.par)
            motor.vary(R_ref=motor.par.R_ref * warm.R, K_ref=motor.par.K_ref * warm.K)
            drive_train.wire(drive, motor, i_ref, w.m.on, force, par)
            heat.u = motor_heat.Input(servo_motor.copper_loss(motor.x, motor.par))
        side, x, k = wedge.side(w.body.xe), w.body.x, roller_screw.slope(par.screw)
        F_stop = end_stop.load(w.stop.f)
        w.body.u = wedge.Input(forces.F_M, w.caliper.f.F_N, F_stop, 0.0, side, w.turning)
        left, right = w.motor_1.x, w.motor_2.x
        w.heart.u = brake_heart.Input(
            k * left.theta, k * right.theta, x.x, k * left.omega, k * right.omega, x.v
        )
        w.adjuster.u = clearance_adjuster.Input(w.m.click_rate)
        taken = clearance_adjuster.moved(w.adjuster.xe, par.adjuster)
        w.caliper.u = wedge_caliper.Input(
            x=x.x,
            v=x.v,
            side=side,
            tan_alpha=wedge.slope(par.wedge),
            runout=flywheel.runout(w.disc.xe, par.flywheel),
            runout_rate=flywheel.runout_rate(w.disc.xe, par.flywheel),
            taken=taken.taken,
            taking=taken.taking,
        )
        w.stop.u = end_stop.Input(x.x, x.v, -par.wedge.x_stop, par.wedge.x_stop)
        w.disc.u = flywheel.Input(self.disc_torque(w))
        w.moment_sensor.u = moment_sensor.Input(w.M_B)
        w.supply.u = drive_supply.Input(
            drive_train.measured_power(w.drive_1, w.motor_1, w.m.i_1_ref, w.m.on)
            + drive_train.measured_power(w.drive_2, w.motor_2, w.m.i_2_ref, w.m.on)
        )

    def disc_torque(self, w: Self) -> float:
        """Return the disc torque [N m] other than its drive's, which is zero on the test stand."""
        return 0.0

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the friction limits on both shafts, on the wedge and on the disc."""
        par = w.par
        shafts = (
            drive_train.bounds(motor.x.omega, drive_train.torque(motor), force, par)
            for motor, force in ((w.motor_1, w.F_1), (w.motor_2, w.F_2))
        )
        F_N, mu_B = w.caliper.f.F_N, w.body.par.mu_B
        pressed = wedge_friction.Input(w.squeeze, F_N, wedge.slope(par.wedge), mu_B, w.turning)
        sliding = wedge_friction.friction(pressed, par.wedge_friction)
        moment = wedge_caliper.moment(F_N, mu_B, 1.0, par.caliper)
        return (*shafts, (-sliding, sliding), (-moment, moment))

    def power(self, w: Self) -> dict[str, float]:
        """Return the powers across the system boundary, and those of the dry frictions."""
        friction_1, friction_2, friction, moment = w.reaction
        motors = drive_train.power(w.motor_1) + drive_train.power(w.motor_2)
        return {
            "W_supply": drive_supply.power(motors, w.supply.par),
            "W_electric": motors,
            "W_disc": wedge.pad_power(w.body.x, w.body.u, w.body.par),
            "W_runout": w.caliper.f.F_N * w.caliper.u.runout_rate,
            "W_adjuster": w.caliper.f.F_N * w.caliper.u.taking,
            "W_brake": -moment * w.disc.x.Omega,
            "E_shaft": -(friction_1 * w.motor_1.x.omega + friction_2 * w.motor_2.x.omega),
            "E_wedge": -friction * w.body.x.v,
            "t_stuck": _stuck(w),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        motors = drive_train.power(w.motor_1) + drive_train.power(w.motor_2)
        heat_1 = motor_heat.stored(w.heat_1.x, w.heat_1.par)
        heat_2 = motor_heat.stored(w.heat_2.x, w.heat_2.par)
        # Without the heat model no operation is needed, because cold motors lose no heat to air.
        cold, none = w.par.motor_heat.law == "off", w.flow.E_motor_air
        supplied = w.flow.W_electric + w.flow.W_disc + w.flow.W_runout
        adjusts = w.par.adjuster.law != "none"
        return {
            "voltage_1": w.motor_1.u.v,
            "voltage_2": w.motor_2.u.v,
            "T_fr_1": -w.reaction[0],
            "T_fr_2": -w.reaction[1],
            "F_fr": -w.reaction[2],
            "F_end": end_stop.load(w.stop.f),
            "contacts": _contact_number(w.heart.f),
            "stuck": _stuck(w),
            "P_in": drive_supply.power(motors, w.supply.par),
            "P_meas": w.supply.x.P,
            "E_source": supplied + w.flow.W_adjuster if adjusts else supplied,
            "W_adjuster": w.flow.W_adjuster if adjusts else 0.0,
            "clearance": w.caliper.par.clearance - w.caliper.u.taken,
            "U_caliper": wedge_caliper.energy(w.caliper.u, w.caliper.par),
            "E_warming": none if cold else w.flow.E_copper,
            "E_winding": none if cold else heat_1.winding + heat_2.winding,
            "E_housing": none if cold else heat_1.housing + heat_2.housing,
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the controllers, the outer one first."""
        T = par.control
        if par.command.mode == "current":
            return (Task("current", T.T_fast, self._current),)
        position = Task("position", T.T_fast, self._position)
        if par.command.mode == "position":
            return (position,)
        moment = Task("moment", T.T_slow, self._moment)
        if par.adjuster.law == "none":
            return (moment, position)
        return (moment, Task("adjuster", T.adjuster.T_adjust, self._adjuster), position)

    def _moment(self, x: Any, m: control.Memory, u: control.Stimulus, par: Par) -> control.Memory:
        return control.moment_tick(readings(x, par), m, u, par)

    def _position(self, x: Any, m: control.Memory, u: control.Stimulus, par: Par) -> control.Memory:
        return control.position_tick(readings(x, par), m, u, par)

    def _adjuster(self, x: Any, m: control.Memory, u: control.Stimulus, par: Par) -> control.Memory:
        return control.adjuster_tick(m, u, par)

    def _current(self, x: Any, m: control.Memory, u: control.Stimulus, par: Par) -> control.Memory:
        return control.current_tick(m, u, par)

    def rest(self, par: Par) -> tuple[Any, control.Memory]:
        """Return the parked brake, with the wedge in its middle, preloaded, without current."""
        return state_at(0.0, par), memory_at(0.0, par)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return the warnings about a recording."""
        return warnings_of(recording, par) + super().watch(recording, par)


def state_at(x: float, par: Par) -> Any:
    """Return the state at rest at a wedge travel [m], with both screws offset from the wedge."""
    k = roller_screw.slope(par.screw)
    apart = par.control.offset.delta_preload / k
    return WedgeBrake.state(
        motor_1=servo_motor.State(i=0.0, theta=x / k - apart, omega=0.0),
        motor_2=servo_motor.State(i=0.0, theta=x / k + apart, omega=0.0),
        body=wedge.State(x=x, v=0.0),
        disc=flywheel.State(Omega=par.flywheel.Omega_0, phi=0.0),
        supply=drive_supply.State(par.supply.P_standby),
        heat_1=motor_heat.cold(par.motor_heat),
        heat_2=motor_heat.cold(par.motor_heat),
    )


def readings(x: Any, par: Par) -> control.Readings:
    """Return the controllers' readings at a tick."""
    return control.Readings(
        theta_1=shaft_encoder.reading(x.theta_1, par.encoder),
        theta_2=shaft_encoder.reading(x.theta_2, par.encoder),
        M=x.y_M,
        Omega=x.Omega,
    )


def _stuck(w: WedgeBrake) -> float:
    """Return 1 if shafts and wedge are at rest, else 0."""
    shafts = ops.fabs(w.motor_1.x.omega) + ops.fabs(w.motor_2.x.omega)
    return ops.where(shafts == 0, 1.0, 0.0) * ops.where(w.body.x.v == 0, 1.0, 0.0)


def _contact_number(forces: brake_heart.Forces) -> float:
    bits = (1.0, 2.0, 4.0)
    closed = (bit * ops.where(f > 0, 1.0, 0.0) for bit, f in zip(bits, forces, strict=True))
    return sum(closed, 0.0)


# --- States at rest: parked, preloaded, without current


def travel_for(F_N: float, par: Par) -> float:
    """Return the wedge travel [m] at a normal force [N], without runout."""
    return (par.caliper.clearance + wedge_caliper.travel(F_N, par.caliper)) / wedge.slope(par.wedge)


def force_for(moment: float, par: Par) -> float:
    """Return the normal force [N] that gives a braking moment [N m]."""
    return moment / wedge_caliper.moment(1.0, par.wedge.mu_B, 1.0, par.caliper)


def contact_angle(par: Par) -> float:
    """Return the motor angle [rad] at which the pads touch."""
    return travel_for(0.0, par) / roller_screw.slope(par.screw)


def memory_at(x: float, par: Par) -> Memory:
    """Return the controllers' memory with the references at a wedge travel [m]."""
    k = roller_screw.slope(par.screw)
    delta = par.control.offset.delta_preload
    both = screw_offset.output(x / k, delta, par.control.offset)
    adjusts = par.adjuster.law != "none"
    return zeros(Memory)._replace(
        on=1.0,
        direction=ops.where(par.flywheel.Omega_0 < 0, -1.0, 1.0),
        theta_c=contact_angle(par),
        gap_hat=par.control.adjuster.gap_slope_hat * contact_angle(par) if adjusts else 0.0,
        theta_ref=x / k,
        delta=delta,
        theta_1_ref=both.theta_1,
        theta_2_ref=both.theta_2,
        last_1=x / k - delta / k,
        last_2=x / k + delta / k,
    )
