"""Current loop of the motorcycle brake's ECU."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Array, Complex, Loop, Point, Quantity
from bywire.brakes.motorcycle.ecu import Stimulus
from bywire.brakes.motorcycle.linear import control_laws
from bywire.brakes.motorcycle.loops.causes import CAUSES
from bywire.brakes.motorcycle.loops.start import require_pressed
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros

_STEP = 10e-6  # substep [s]: at most 1/(100 f) in the loop's band, or midpoint's own error shows


def point(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a pressure [Pa] by its current."""
    require_pressed(value)
    own = cast(MotorcycleParameters, par.replace({"drive.mode": "current-direct"}))
    state, memory = state_at(value, own), memory_at(value, own)
    stimulus = zeros(Stimulus)._replace(i_set=state.i)
    return Point(MotorcycleBrake(), own, state, memory, stimulus, _STEP)


def laws(par: ParameterSet, value: float, frequencies: Array) -> tuple[Complex, Complex]:
    """Return what the PI makes of set point and current, up to its duty cycle, at any pressure."""
    own = cast(MotorcycleParameters, par)
    pi = control_laws.current_control(own.ecu).response(frequencies)[:, 0, 0]
    return pi, pi / (1.0 + 1j * frequencies / own.anti_alias.f_aa)


LOOP = Loop(
    name="current",
    assembly="motorcycle-brake",
    summary="current control, 1 kHz, rotor free",
    at=Quantity("pressure", "Pa", 20e5),
    inputs=("i_set",),
    output="i",
    cut="duty",
    point=point,
    causes=CAUSES,
    band=(1.0, 400.0),
    amplitudes=(1e-2, 1.0),
    tunables={"ecu.current.k_p": (1e-4, 0.1), "ecu.current.k_i": (0.1, 200.0)},
    proof="current-step",
    laws=laws,
)
