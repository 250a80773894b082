"""Pressure loop of the motorcycle brake, around its current loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from bywire.analysis.loop import Array, Complex, Loop, Point, Quantity
from bywire.analysis.loop_schedule import LoopSchedule
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.linear import control_laws
from bywire.brakes.motorcycle.loops.causes import CAUSES
from bywire.brakes.motorcycle.loops.start import require_pressed
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros


def point(par: ParameterSet, value: float) -> Point:
    """Return the brake in equilibrium at a pressure [Pa]."""
    require_pressed(value)
    own = cast(MotorcycleParameters, par.replace({"drive.mode": "pressure"}))
    stimulus = zeros(Stimulus)._replace(p_set=value)
    return Point(MotorcycleBrake(), own, state_at(value, own), memory_at(value, own), stimulus)


def whole(par: ParameterSet) -> Sequence[float]:
    """Return the dither's frequency [Hz], where there is one."""
    dither = cast(MotorcycleParameters, par).ecu.dither
    return () if dither.waveform == "off" else (dither.f_dit,)


def laws(par: ParameterSet, value: float, frequencies: Array) -> tuple[Complex, Complex]:
    """Return what the PID makes of set point and pressure at a pressure [Pa], up to its demand."""
    own = cast(MotorcycleParameters, par)
    demand = control_laws.pressure_demand(own.ecu, value).response(frequencies)[:, 0, 0]
    feedback = control_laws.pressure_feedback(own.ecu, value).response(frequencies)[:, 0, 0]
    return demand, feedback / (1.0 + 1j * frequencies / own.anti_alias.f_aa)


_GAINS = {"k_p": (5e-7, 1e-4), "k_i": (1e-6, 3e-3), "k_d": (1e-9, 3e-6)}
_OWN = {f"ecu.pressure.{name}": span for name, span in _GAINS.items()} | {
    "ecu.pressure.tau_d": (5e-5, 1e-2), "ecu.pressure.b": (0.0, 1.0), "ecu.pressure.c": (0.0, 1.0),
}  # fmt: skip

LOOP = Loop(
    name="pressure",
    assembly="motorcycle-brake",
    summary="pressure control around current control, 1 kHz",
    at=Quantity("pressure", "Pa", 20e5),
    inputs=("p_set",),
    output="p_mc",
    cut="y_p",
    point=point,
    causes=CAUSES,
    band=(0.1, 50.0),
    amplitudes=(1e4, 1e5, 3e5),
    whole=whole,
    tunables=_OWN,
    proof="hard-braking",
    laws=laws,
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
