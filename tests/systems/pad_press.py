"""A brake in one file: a motor presses pads that have hysteresis; its angle is controlled."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from bywire.authoring import (
    Assembly,
    Brake,
    Case,
    CitedSet,
    Duration,
    Experiment,
    Integral,
    Kpi,
    Loop,
    ParameterSet,
    Part,
    Point,
    Quantity,
    Recordings,
    Role,
    Signal,
    Sub,
    Task,
    Torque,
    Unit,
    Wire,
    evaluate,
    units_of,
    zeros,
)
from bywire.bench.kpis import extremes
from bywire.core.quantities import GearRatio, Stiffness
from bywire.plant import pad_hysteresis, shaft

FRICTION = Role("sink", "dry friction")


class Parameters(ParameterSet):
    """All parameters."""

    shaft: shaft.Parameters
    pads: pad_hysteresis.Parameters
    lead: GearRatio
    k_c: Stiffness
    T_fr: Torque
    k_p: Annotated[float, Unit("N*m/rad"), Field(gt=0, allow_inf_nan=False)]
    k_d: Annotated[float, Unit("N*m*s/rad"), Field(gt=0, allow_inf_nan=False)]
    T_s: Duration


class Memory(NamedTuple):
    """Torque between ticks."""

    T: Annotated[float, Signal("N*m", "torque demand", 1.0)]


class Stimulus(NamedTuple):
    """Angle demand."""

    angle_set: Annotated[float, Signal("rad", "angle demand", 2.0)]


class PadPress(Assembly[Parameters, Memory]):
    """A shaft with dry friction, a screw, an elastic caliper, and pads beside it."""

    name: ClassVar[str] = "pad-press"
    Memory: ClassVar[Any] = Memory
    Stimulus: ClassVar[Any] = Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy of the drive", role=Role("source", "drive"))
    shaft = Part(shaft, loss="E_damping")
    pads = Part(pad_hysteresis, loss="E_pads", output=("F_hysteresis",))
    E_friction = Integral("J", "loss of the dry friction", role=FRICTION)

    travel = Wire("m", "travel", 1e-4)
    F = Wire("N", "clamp force", 1e4)

    def wire(self, w):
        """Connect the parts."""
        w.travel = w.par.lead * w.shaft.x.theta
        elastic = w.par.k_c * w.travel
        w.pads.u = pad_hysteresis.Input(w.par.lead * w.shaft.x.omega, elastic)
        w.F = elastic + pad_hysteresis.output(w.pads.x, w.pads.par).F_hysteresis
        w.shaft.u = shaft.Input(w.m.T - w.par.lead * w.F, 0.0)

    def friction(self, w):
        """Return both bounds."""
        return ((-w.par.T_fr, w.par.T_fr),)

    def power(self, w):
        """Return the powers of drive and friction."""
        omega = w.shaft.x.omega
        return {"E_source": w.m.T * omega, "E_friction": -w.reaction[0] * omega}

    def record(self, w):
        """Add the energy of the caliper."""
        return {"E_stored": self.stored(w) + 0.5 * w.par.k_c * w.travel * w.travel}

    def tasks(self, par):
        """Return the control."""
        return (Task("control", par.T_s, control),)


def control(x, m, u, par):
    """Run the control of the angle."""
    return Memory(par.k_p * (u.angle_set - x.theta) - par.k_d * x.omega)


class TwoPresses(Assembly[Any, Any]):
    """Two presses in one assembly."""

    name: ClassVar[str] = "two-presses"
    left = Sub(PadPress, prefix="left_")
    right = Sub(PadPress, prefix="right_", feeds={"angle_set": "left_angle_set"})


class TwoParameters(ParameterSet):
    """Parameters of both."""

    left: Parameters
    right: Parameters


PADS = pad_hysteresis.Parameters(
    law="constant",
    k_1=4e6,
    k_2=3e6,
    k_3=2e6,
    k_4=1e6,
    W_1=50.0,
    W_2=150.0,
    W_3=300.0,
    W_4=400.0,
    F_ref=2e3,
)
PAR = Parameters(
    shaft=shaft.Parameters(J=2e-4, d=1e-4),
    pads=PADS,
    lead=1e-4,
    k_c=1e7,
    T_fr=0.02,
    k_p=0.4,
    k_d=0.012,
    T_s=1e-3,
)
SETS = tuple(
    CitedSet(name, "pad-press", "", "a press", Parameters, PAR.replace(changes).flat())
    for name, changes in (("press-one", {}), ("press-by-load", {"pads.law": "load"}))
)
BRAKE = Brake("pad-press", "a shaft that presses pads with hysteresis", __name__)


class Options(ParameterSet):
    """Cycles of pressing."""

    amplitude: Annotated[float, Unit("rad", 1.0), Field(gt=0, allow_inf_nan=False)]
    period: Duration
    duration: Duration


def cases(par: Parameters, options: Options, _: Any) -> tuple[Case, ...]:
    """Return the run."""

    def stimulus(t: np.ndarray) -> dict[str, np.ndarray]:
        wave = np.sin(2.0 * np.pi * t / options.period) ** 2
        return {"angle_set": np.where(t >= 0.0, options.amplitude * wave, 0.0)}

    return (
        Case(
            "run",
            PadPress(),
            par,
            zeros(PadPress.State),
            zeros(Memory),
            stimulus,
            duration=options.duration,
            start=lambda _: (zeros(PadPress.State), zeros(Memory)),
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the largest force."""
    return tuple(evaluate("extremes", recordings["run"], extremes.Setting("F")).values())


EXPERIMENT = Experiment(
    name="press-and-release",
    assembly="pad-press",
    summary="press and release",
    options=Options,
    defaults=Options(amplitude=4.0, period=0.2, duration=0.3),
    cases=cases,
    judge=judge,
    kpis=units_of("extremes", resolved={"level": "N"}),
    figures=("time-traces",),
)


def point(par: Parameters, value: float) -> Point:
    """Return the press at an angle, without hysteresis: after a decaying oscillation."""
    T = par.lead * par.lead * par.k_c * value
    state = PadPress.state(shaft=shaft.State(value, 0.0))
    return Point(PadPress(), par, state, Memory(T), Stimulus(value + T / par.k_p))


LOOP = Loop(
    name="press-angle",
    assembly="pad-press",
    summary="angle control",
    at=Quantity("angle", "rad", 2.0),
    inputs=("angle_set",),
    output="theta",
    cut="T",
    point=point,
    causes={"dry friction": {"T_fr": 0.0}},
    band=(0.1, 100.0),
    amplitudes=(0.1,),
)
