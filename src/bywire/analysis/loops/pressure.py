"""Pressure loop of the motorcycle brake, around its current loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.analysis.loops.motorcycle_causes import CAUSES
from bywire.assemblies.motorcycle_brake import MotorcycleBrake
from bywire.assemblies.motorcycle_ecu import Stimulus
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_trim import memory_at, state_at
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros


def point(par: ParameterSet, value: float) -> Point:
    """Return the brake in equilibrium at a pressure [Pa]."""
    own = cast(MotorcycleParameters, par.replace({"drive.mode": "pressure"}))
    stimulus = zeros(Stimulus)._replace(p_set=value)
    return Point(MotorcycleBrake(), own, state_at(value, own), memory_at(value, own), stimulus)


def whole(par: ParameterSet) -> Sequence[float]:
    """Return the dither's frequency [Hz], where there is one."""
    dither = cast(MotorcycleParameters, par).ecu.dither
    return () if dither.waveform == "off" else (dither.f_dit,)


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
)
