"""Control loops of the motorcycle brake's ECU: current, and pressure around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from bywire.analysis.loop import Loop, LoopSchedule, Point, Quantity
from bywire.brakes.motorcycle import linear
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.core.typing import Array, Complex

_STEP = 10e-6  # substep [s]: at most 1/(100 f) of the current loop's band, for a small error

CAUSES: Mapping[str, Mapping[str, Any]] = {
    "seal friction": {"seal.T_pr": 0.0, "seal.f_cfr_p": 0.0, "seal.f_cfr_n": 0.0, "seal.mu_T": 0.0},
    "dither": {"ecu.dither.waveform": "off"},
    "converter": {"adc.law": "ideal"},
}
"""changes that remove a cause of nonlinearity, keyed by the cause"""


def _require_pressed(p: float) -> None:
    """Reject a released brake, since a piston that just touches its stop has no linear model."""
    if p == 0.0:
        raise not_valid(
            "pressure", "0 bar", "> 0 bar", "because the piston just touches its stop at 0 bar"
        )


def current_point(par: ParameterSet, value: float) -> Point:
    """Return the brake held by its current at a pressure [Pa]."""
    _require_pressed(value)
    closed = cast(MotorcycleParameters, par.replace({"drive.mode": "current-direct"}))
    state, memory = state_at(value, closed), memory_at(value, closed)
    stimulus = zeros(Stimulus)._replace(i_set=state.i)
    return Point(MotorcycleBrake(), closed, state, memory, stimulus, _STEP)


def current_laws(par: ParameterSet, value: float, frequencies: Array) -> tuple[Complex, Complex]:
    """Return the PI's responses from set point and from current to the duty cycle."""
    brake = cast(MotorcycleParameters, par)
    pi = linear.current_control(brake.ecu).response(frequencies)[:, 0, 0]
    return pi, pi / (1.0 + 1j * frequencies / brake.anti_alias.f_aa)


def pressure_point(par: ParameterSet, value: float) -> Point:
    """Return the brake in equilibrium at a pressure [Pa]."""
    _require_pressed(value)
    closed = cast(MotorcycleParameters, par.replace({"drive.mode": "pressure"}))
    stimulus = zeros(Stimulus)._replace(p_set=value)
    state, memory = state_at(value, closed), memory_at(value, closed)
    return Point(MotorcycleBrake(), closed, state, memory, stimulus)


def dither_frequency(par: ParameterSet) -> Sequence[float]:
    """Return the dither's frequency [Hz]; empty without dither."""
    dither = cast(MotorcycleParameters, par).ecu.dither
    return () if dither.waveform == "off" else (dither.f_dit,)


def pressure_laws(par: ParameterSet, value: float, frequencies: Array) -> tuple[Complex, Complex]:
    """Return the PID's responses from set point and pressure to its demand, at a pressure."""
    brake = cast(MotorcycleParameters, par)
    demand = linear.pressure_demand(brake.ecu, value).response(frequencies)[:, 0, 0]
    feedback = linear.pressure_feedback(brake.ecu, value).response(frequencies)[:, 0, 0]
    return demand, feedback / (1.0 + 1j * frequencies / brake.anti_alias.f_aa)


_SLOWEST = 1e-2  # time constant of the derivative's filter [s]
_GAINS = {"k_p": (5e-7, 1e-4), "k_i": (1e-6, 3e-3), "k_d": (1e-9, 3e-6)}
_OWN = {f"ecu.pressure.{name}": span for name, span in _GAINS.items()} | {
    "ecu.pressure.tau_d": (5e-5, _SLOWEST),
    "ecu.pressure.b": (0.0, 1.0),
    "ecu.pressure.c": (0.0, 1.0),
}


def in_ecu(par: ParameterSet) -> Mapping[str, tuple[float, float]]:
    """Return the limits of a pressure PID that an ECU can run.

    A filter faster than the sampling has no effect: backward differences then pass every
    converter step without damping. The derivative of a set point step exceeds the current limit
    for one sample.
    """
    T_s = cast(MotorcycleParameters, par).ecu.T_s
    return {"ecu.pressure.tau_d": (T_s, max(_SLOWEST, 10.0 * T_s)), "ecu.pressure.c": (0.0, 0.0)}


CURRENT = Loop(
    name="current",
    assembly="motorcycle-brake",
    summary="current control with a free rotor, 1 kHz",
    at=Quantity("pressure", "Pa", 20e5),
    inputs=("i_set",),
    output="i",
    cut="duty",
    point=current_point,
    causes=CAUSES,
    band=(1.0, 400.0),
    amplitudes=(1e-2, 1.0),
    tunables={"ecu.current.k_p": (1e-4, 0.1), "ecu.current.k_i": (0.1, 200.0)},
    proof="current-step",
    laws=current_laws,
)

PRESSURE = Loop(
    name="pressure",
    assembly="motorcycle-brake",
    summary="pressure control around current control, 1 kHz",
    at=Quantity("pressure", "Pa", 20e5),
    inputs=("p_set",),
    output="p_mc",
    cut="y_p",
    point=pressure_point,
    causes=CAUSES,
    band=(0.1, 50.0),
    amplitudes=(1e4, 1e5, 3e5),
    whole=dither_frequency,
    tunables=_OWN,
    realizable=in_ecu,
    proof="hard-braking",
    laws=pressure_laws,
    schedule=LoopSchedule(
        changes={"ecu.schedule.law": "regions"},
        borders=("ecu.schedule.p_1", "ecu.schedule.p_2"),
        regions={
            "low": {f"ecu.schedule.low.{name}": span for name, span in _GAINS.items()},
            "medium": _OWN,
            "high": {f"ecu.schedule.high.{name}": span for name, span in _GAINS.items()},
        },
        main="medium",
        points=(5e5, 20e5, 37e5),
    ),
)
