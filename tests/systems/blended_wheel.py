"""A quarter car with a motor, and a friction brake that follows its demand with a lag."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.authoring import (
    Brake,
    Channels,
    CitedSet,
    Duration,
    Integral,
    ParameterSet,
    Part,
    Role,
    Shown,
    Signal,
    chosen,
)
from bywire.plant import road_wheel
from bywire.vehicle import (
    Blended,
    CornerParameters,
    RegeneratingCorner,
    WheelSpeed,
    blended_stop,
    regeneration,
    rolling_states,
)

Torque = Annotated[float, Signal("N*m", "torque of the friction brake", 300.0)]


class LagParameters(ParameterSet):
    """First-order lag."""

    tau: Duration
    """time constant"""


class LagState(NamedTuple):
    """Torque."""

    T_b: Torque


class LagInput(NamedTuple):
    """Demand."""

    T_ref: Torque


class LagRate(NamedTuple):
    """Rate of the torque."""

    T_b: Annotated[float, Signal("N*m/s", "rate of the torque", 1e3)]


class friction_lag:  # noqa: N801  stands for a module
    """Friction brake that follows its demand with a lag."""

    Parameters, State, Input = LagParameters, LagState, LagInput

    @staticmethod
    def rate(x: LagState, u: LagInput, par: LagParameters) -> LagRate:
        return LagRate((u.T_ref - x.T_b) / par.tau)


class Parameters(ParameterSet):
    """Lag, wheel, car, and regeneration."""

    lag: LagParameters
    wheel: road_wheel.Parameters
    corner: CornerParameters
    regeneration: regeneration.Parameters


class BlendedWheel(RegeneratingCorner[Parameters, regeneration.Memory]):
    """The wheel has one dry friction, the brake, and no rolling resistance."""

    name = "blended-wheel"
    Memory, Stimulus = regeneration.Memory, regeneration.Demand
    frictions = ("omega",)

    turning = Part(road_wheel, par="wheel", outside=True)
    lag = Part(friction_lag)
    E_brake = Integral("J", "friction brake", role=Role("sink", "brake", book="vehicle"))
    E_wheel = Shown(
        "J", "energy of the wheel", role=Role("sink", "wheel", returns="any", book="vehicle")
    )
    T_f = Shown("N*m", "torque of the friction brake", 300.0)

    def wheel(self, w):
        return WheelSpeed(w.turning.x.omega, w.turning.xe.omega)

    def wire(self, w):
        w.lag.u = LagInput(w.m.T_brake)
        w.turning.u = road_wheel.Input(self.tyre_torque(w) / w.turning.par.r, 0.0)

    def friction(self, w):
        return ((-w.lag.x.T_b, w.lag.x.T_b),)

    def power(self, w):
        return {**super().power(w), "E_brake": -w.reaction[0] * w.turning.x.omega}

    def record(self, w):
        wheel = road_wheel.energy(w.turning.x, w.turning.par)
        return {**super().record(w), "T_f": -w.reaction[0], "E_wheel": wheel}

    def rest(self, par):
        return at_speed(0.0, par, 0.5)


def at_speed(v, par, soc):
    """Return the car at a speed [m/s], without braking torque."""
    state = BlendedWheel.state(
        **rolling_states(v),
        **regeneration.charged(soc),
        turning=road_wheel.State(v / par.wheel.r),
        lag=LagState(0.0),
    )
    return state, regeneration.Memory(**regeneration.awake(v))


STOP = blended_stop(
    "blended-stop",
    Blended(BlendedWheel, at_speed, friction="T_f", kinetic=("E_body", "E_wheel")),
    {},
)

CHANNELS = Channels("blended-wheel", regeneration.CHANNELS)

_TYRE = {"sigma": 0.2, "c_t": 1.1, "v_low": 2.0, "tau_slide": 1e-4, "curve": "burckhardt"}
_STRETCH = {"c1": 1.2801, "c2": 23.99, "c3": 0.52, "B": 10.0, "C": 1.9, "D": 1.0, "E": 0.97}
_ROAD = {
    "grip": 1.0,
    "x_change": 1e4,
    "x_back": 2e4,
    "ramp": 0.01,
    "gradient": 0.0,
    "gradient_further": 0.0,
}
_MOTOR = {
    "T_max": 500.0,
    "P_max": 25e3,
    "eta": 0.9,
    "v_1": 15 / 3.6,
    "v_2": 5 / 3.6,
    "tau": 0.010,
}
_BATTERY = {
    "law": "constant",
    "P_max": 25e3,
    "Q": 1.35e5,
    "V_0": 320.0,
    "V_1": 410.0,
    "V_max": 410.0,
    "R": 0.4,
    "I_max": 75.0,
    "T": 298.15,
    "T_cold": 263.15,
    "T_warm": 283.15,
}
_NUMBERS = {
    "lag.tau": 0.06,
    "wheel.J": 0.9,
    "wheel.r": 0.3,
    "wheel.C_rr": 0.0,
    "corner.body.m": 390.0,  # and 10 kg of the wheel's inertia
    "corner.body.g": 9.81,
    "corner.r": 0.3,
    **{f"corner.tyre.{key}": value for key, value in _TYRE.items()},
    **{f"corner.road.{key}": value for key, value in _ROAD.items()},
    **{
        f"corner.road.{stretch}.{key}": value
        for stretch in ("first", "further")
        for key, value in _STRETCH.items()
    },
    **{f"regeneration.motor.{key}": value for key, value in _MOTOR.items()},
    **{f"regeneration.battery.{key}": value for key, value in _BATTERY.items()},
    "regeneration.blending.category": "B",
    "regeneration.blending.law": "reported",
    "regeneration.blending.rate": 1e5,
    "regeneration.blending.T_least": 0.0,
    "regeneration.blending.t_off": 0.05,
    "regeneration.blending.t_back": 0.3,
    "regeneration.bus.T_d": 0.01,
    "regeneration.T_s": 1e-3,
    "regeneration.t_ahead": 0.07,
    "regeneration.tau_a": 0.02,
}
SET = CitedSet(
    "blended",
    "blended-wheel",
    "chosen for a trial",
    "a wheel of a compact electric car",
    Parameters,
    {name: chosen(value, "trial") for name, value in _NUMBERS.items()},
)
BRAKE = Brake("blended", "a motor and a friction brake at a wheel", __name__)
