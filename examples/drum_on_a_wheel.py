"""Your own brake on a wheel in one file: a hydraulic drum that stops a quarter car.

Elements come from `bywire.plant`, and the car from `bywire.vehicle`. The page "Vehicles" explains
this file.
"""

from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from bywire.authoring import (
    Area,
    Brake,
    Case,
    CitedSet,
    Duration,
    Experiment,
    Figures,
    Integral,
    ParameterSet,
    Part,
    Shown,
    Signal,
    Task,
    Unit,
    chosen,
    derived,
)
from bywire.plant import drum, pressure_loop, road_wheel
from bywire.vehicle import (
    Corner,
    CornerParameters,
    RidingSpeed,
    WheelSpeed,
    rolling_states,
    vehicle_sink,
)

DemandedPressure = Annotated[float, Unit("Pa", 3e6), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Drum, its pressure loop and wheel cylinder, the wheel, and the car."""

    circuit: pressure_loop.Parameters
    drum: drum.Parameters
    A_cylinder: Area
    """area of a wheel cylinder's piston"""
    wheel: road_wheel.Parameters
    corner: CornerParameters
    T_s: Duration
    """sample time of the demand"""


class Stimulus(NamedTuple):
    """External inputs."""

    p_set: Annotated[float, Signal("Pa", "pressure demand", 3e6)]


class Memory(NamedTuple):
    """Demand held between two ticks."""

    p_ref: Annotated[float, Signal("Pa", "pressure set point", 3e6, set_point_of="p")]


class DrumOnAWheel(Corner[Parameters, Memory]):
    """A quarter car whose wheel has one dry friction: drum and rolling resistance."""

    name = "drum-on-a-wheel"
    Memory, Stimulus = Memory, Stimulus
    frictions = ("omega",)

    turning = Part(road_wheel, par="wheel", outside=True)
    circuit = Part(pressure_loop)
    shoes = Part(drum, par="drum")
    E_brake = Integral("J", "drum and rolling resistance", role=vehicle_sink("brake"))
    E_wheel = Shown("J", "energy of the wheel", role=vehicle_sink("wheel", "any"))
    torque = Shown("N*m", "brake torque", 500.0)

    def wheel(self, w):
        """Return the speed of the wheel, which `Corner` needs."""
        return WheelSpeed(w.turning.x.omega, w.turning.xe.omega)

    def wire(self, w):
        """Connect the road to the wheel, and the pressure to the shoes."""
        w.circuit.u = pressure_loop.Input(w.m.p_ref)
        force = w.par.A_cylinder * w.circuit.x.p
        w.shoes.u = drum.Input(force, w.turning.x.omega)
        road_torque = self.tyre_torque(w)
        w.turning.u = road_wheel.Input(road_torque / w.turning.par.r, 0.0)

    def friction(self, w):
        """Return the bounds of the friction at the wheel; at standstill it is between them."""
        bounds = drum.output(w.shoes.u, w.shoes.par)
        rolling = road_wheel.rolling_resistance(w.N_x, w.turning.par)
        return ((-bounds.T_p - rolling, bounds.T_n + rolling),)

    def power(self, w):
        """Return the power of the brake in addition to those of the car."""
        return {**super().power(w), "E_brake": -w.reaction[0] * w.turning.x.omega}

    def record(self, w):
        """Return brake torque and energy of the wheel in addition to the signals of the car."""
        wheel = road_wheel.energy(w.turning.x, w.turning.par)
        return {**super().record(w), "torque": -w.reaction[0], "E_wheel": wheel}

    def tasks(self, par):
        """Return the task that samples the demand."""
        return (Task("demand", par.T_s, lambda x, m, u, par: Memory(u.p_set)),)

    def rest(self, par):
        """Return the car at rest without pressure."""
        return rolling(par, 0.0)


def rolling(par, v):
    """Return state and memory of the rolling car at a speed [m/s]."""
    wheel = road_wheel.State(v / par.wheel.r)
    circuit = pressure_loop.State(0.0, 0.0)
    return DrumOnAWheel.state(**rolling_states(v), turning=wheel, circuit=circuit), Memory(0.0)


class Options(ParameterSet):
    """The stop."""

    v_0: RidingSpeed
    """initial speed"""
    p: DemandedPressure
    """demanded pressure"""
    duration: Duration
    """recording time"""


FIGURES = Figures(
    undefined="the car does not stop within the recording",
    stopping_distance=("m", "Distance from the demand to standstill."),
    peak_torque=("N*m", "Maximum brake torque."),
)


def cases(par, options, _=None):
    """Return the single run."""
    start = rolling(par, options.v_0)

    def demand(t):
        return {"p_set": np.where(t >= 0, options.p, 0.0)}

    return (Case("run", DrumOnAWheel(), par, *start, demand, options.duration),)


def judge(recordings, options):
    """Return the key figures of the stop."""
    run = recordings["run"]
    still = np.flatnonzero(run["v_x"].values <= 0.01)
    distance = float(run["s"].values[still[0]]) if still.size else float("nan")
    return FIGURES(stopping_distance=distance, peak_torque=float(run["torque"].max()))


STOP = Experiment(
    name="drum-stop",
    assembly="drum-on-a-wheel",
    summary="stop from {v_0:km/h} with {p:bar}",
    options=Options,
    defaults=Options(v_0=22.2, p=50e5, duration=8.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)

_LAYOUT = "rear drum of a compact car"
_ROAD = "dry asphalt, Burckhardt"
_STRETCH = {"c1": 1.2801, "c2": 23.99, "c3": 0.52, "B": 10.0, "C": 1.9, "D": 1.0, "E": 0.97}
_NUMBERS = {
    "circuit.f_n": chosen(8.0, "typical speed of a by-wire brake"),
    "circuit.zeta": chosen(0.9, "little overshoot"),
    "drum.law": chosen("simplex", _LAYOUT),
    "drum.r": chosen(0.1015, _LAYOUT),
    "drum.b": chosen(0.036, _LAYOUT),
    "drum.a": chosen(0.083, _LAYOUT),
    "drum.c": chosen(0.165, _LAYOUT),
    "drum.theta_1": chosen(0.3, _LAYOUT),
    "drum.theta_2": chosen(2.3, _LAYOUT),
    "drum.mu": chosen(0.35, "organic lining"),
    "A_cylinder": derived(2.85e-4, "diameter of 19.05 mm"),
    "wheel.J": chosen(0.9, "wheel, tire and drum"),
    "wheel.r": chosen(0.29, _LAYOUT),
    "wheel.C_rr": chosen(0.012, "car tire on asphalt"),
    "corner.body.m": chosen(300.0, "a quarter of a compact car"),
    "corner.body.g": chosen(9.81, "standard gravity"),
    "corner.r": chosen(0.29, _LAYOUT),
    "corner.tyre.sigma": chosen(0.2, "car tire, about the length of its contact patch"),
    "corner.tyre.c_t": chosen(1.1, "a tenth of critical damping of a vehicle on stuck tires"),
    "corner.tyre.v_low": chosen(2.0, "relaxation damps above this speed"),
    "corner.tyre.tau_slide": chosen(1e-4, "short compared with all vehicle motions"),
    "corner.tyre.curve": chosen("burckhardt", _ROAD),
    "corner.road.grip": chosen(1.0, _ROAD),
    "corner.road.x_change": chosen(1e4, "one surface"),
    "corner.road.x_back": chosen(2e4, "one surface"),
    "corner.road.ramp": chosen(0.01, "one surface"),
    "corner.road.gradient": chosen(0.0, "level road"),
    "corner.road.gradient_further": chosen(0.0, "level road"),
    **{
        f"corner.road.{stretch}.{key}": chosen(value, _ROAD)
        for stretch in ("first", "further")
        for key, value in _STRETCH.items()
    },
    "T_s": chosen(1e-3, "1 kHz"),
}
SET = CitedSet(
    "compact-rear", "drum-on-a-wheel", "our own layout", "a rear drum", Parameters, _NUMBERS
)
BRAKE = Brake("drum", "hydraulic drum on a wheel", __name__)
