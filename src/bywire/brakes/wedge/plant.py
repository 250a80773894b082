"""Wiring of the wedge brake's plant: which element feeds which, at one instant."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.control import Memory
from bywire.brakes.wedge.drive_train import Side
from bywire.brakes.wedge.elements import brake_heart, wedge, wedge_caliper, wedge_friction
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.signals import Signal
from bywire.plant import current_drive, end_stop, flywheel, roller_screw, servo_motor

Par = WedgeParameters
HEART = 3  # contacts of the brake heart; then caliper, near stop, far stop


class State(NamedTuple):
    """Continuous states of drives, motors, wedge, disc and measurements."""

    demand_1: Annotated[float, Signal("A", "filtered current demand 1", 5.0)]
    sensed_1: Annotated[float, Signal("A", "sensed current 1", 5.0)]
    integral_1: Annotated[float, Signal("1", "integral part of drive 1", 0.1)]
    i_1: Annotated[float, Signal("A", "current 1", 5.0)]
    theta_1: Annotated[float, Signal("rad", "motor angle 1", 3.0)]
    omega_1: Annotated[float, Signal("rad/s", "motor speed 1", 50.0)]
    demand_2: Annotated[float, Signal("A", "filtered current demand 2", 5.0)]
    sensed_2: Annotated[float, Signal("A", "sensed current 2", 5.0)]
    integral_2: Annotated[float, Signal("1", "integral part of drive 2", 0.1)]
    i_2: Annotated[float, Signal("A", "current 2", 5.0)]
    theta_2: Annotated[float, Signal("rad", "motor angle 2", 3.0)]
    omega_2: Annotated[float, Signal("rad/s", "motor speed 2", 50.0)]
    x: Annotated[float, Signal("m", "wedge travel", 1e-3)]
    v: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    Omega: Annotated[float, Signal("rad/s", "disc speed", 60.0)]
    phi: Annotated[float, Signal("rad", "disc angle", 10.0)]
    y_M: Annotated[float, Signal("N*m", "moment shown by the sensor", 300.0)]
    y_P: Annotated[float, Signal("W", "input power, filtered", 50.0)]


class Wires(NamedTuple):
    """What the mechanical elements exchange."""

    F_1: Annotated[float, Signal("N", "axial force on screw 1", 400.0)]
    F_2: Annotated[float, Signal("N", "axial force on screw 2", 400.0)]
    F_M: Annotated[float, Signal("N", "actuation force", 400.0)]
    squeeze: Annotated[float, Signal("N", "sum of the forces on the wedge", 800.0)]
    F_N: Annotated[float, Signal("N", "normal force", 3e3)]
    F_stop: Annotated[float, Signal("N", "load of the end stops", 100.0)]
    side: Annotated[float, Signal("1", "side of the wedge")]
    turning: Annotated[float, Signal("1", "direction of the disc")]
    M_B: Annotated[float, Signal("N*m", "braking moment", 300.0)]


def sides(x: State, xe: State, m: Memory, par: Par) -> tuple[Side, Side]:
    """Return both drives and motors; angles are value-only, for the cogging."""
    return (
        Side(
            current_drive.State(x.demand_1, x.sensed_1, x.integral_1),
            servo_motor.State(x.i_1, xe.theta_1, x.omega_1),
            m.i_1_ref,
            par.motor_1,
        ),
        Side(
            current_drive.State(x.demand_2, x.sensed_2, x.integral_2),
            servo_motor.State(x.i_2, xe.theta_2, x.omega_2),
            m.i_2_ref,
            par.motor_2,
        ),
    )


def motor_power(x: State, m: Memory, par: Par) -> float:
    """Return the electrical power of both motors [W]."""
    return sum((drive_train.power(s, m.on, par) for s in sides(x, x, m, par)), 0.0)


def wires(xe: State, par: Par, contact: tuple[float, ...]) -> Wires:
    """Return what flows between the mechanical elements.

    Parameters
    ----------
    contact
        Forces of the heart's three contacts, the caliper, the near and the far end stop [N].
    """
    heart = brake_heart.output(brake_heart.Forces(*contact[:HEART]))
    F_N = wedge_caliper.normal_force(contact[HEART], par.caliper)
    turning = flywheel.turning(flywheel.State(xe.Omega, xe.phi), par.flywheel)
    return Wires(
        **heart._asdict(),
        F_N=F_N,
        F_stop=end_stop.load(end_stop.Forces(*contact[HEART + 1 :])),
        side=wedge.side(wedge.State(xe.x, xe.v)),
        turning=turning,
        M_B=wedge_caliper.moment(F_N, par.wedge.mu_B, turning, par.caliper),
    )


def wedge_input(w: Wires, friction: float) -> wedge.Input:
    """Return the forces on the wedge."""
    return wedge.Input(w.F_M, w.F_N, w.F_stop, friction, w.side, w.turning)


def heart_input(x: State, par: Par) -> brake_heart.Input:
    """Return travels and velocities of screws and wedge."""
    k = roller_screw.slope(par.screw)
    return brake_heart.Input(
        k * x.theta_1, k * x.theta_2, x.x, k * x.omega_1, k * x.omega_2, x.v
    )  # fmt: skip


def caliper_input(x: State, xe: State, par: Par) -> wedge_caliper.Input:
    """Return what the caliper sees; side and run-out are value-only."""
    disc = flywheel.State(xe.Omega, xe.phi)
    return wedge_caliper.Input(
        x=x.x,
        v=x.v,
        side=wedge.side(wedge.State(xe.x, xe.v)),
        tan_alpha=wedge.slope(par.wedge),
        runout=flywheel.runout(disc, par.flywheel),
        runout_rate=flywheel.runout_rate(disc, par.flywheel),
    )


def stop_input(x: State, par: Par) -> end_stop.Input:
    """Return what the wedge's end stops see."""
    return end_stop.Input(x=x.x, v=x.v, x_rest=-par.wedge.x_stop, x_end=par.wedge.x_stop)


def wedge_bound(w: Wires, par: Par) -> float:
    """Return the magnitude of the friction on the wedge [N]."""
    return wedge_friction.friction(
        wedge_friction.Input(w.squeeze, w.F_N, wedge.slope(par.wedge), par.wedge.mu_B, w.turning),
        par.wedge_friction,
    )
