"""Position loop of the assembled wedge: both motors follow one reference."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.analysis.loops.wedge_causes import CAUSES, DRIVE_LIMITS
from bywire.assemblies.wedge_brake import WedgeBrake
from bywire.assemblies.wedge_control import Stimulus
from bywire.assemblies.wedge_parameters import WedgeParameters
from bywire.assemblies.wedge_start import memory_at, state_at, travel_for
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros


def point(par: ParameterSet, value: float) -> Point:
    """Return the wedge at a travel [m] within the clearance, preloaded between the screws.

    Raises
    ------
    ParameterError
        When the pads would press.
    """
    own = cast(WedgeParameters, par.replace({"command.mode": "position"}))
    free = min(travel_for(0.0, own), own.wedge.x_stop)
    if not abs(value) < free:
        raise ParameterError(
            f"wedge travel = {value * 1e3:g} mm is out of the clearance: it must be between "
            f"{-free * 1e3:.3g} and {free * 1e3:.3g} mm"
        )
    memory = memory_at(value, own)
    stimulus = zeros(Stimulus)._replace(
        theta_1_set=memory.theta_1_ref, theta_2_set=memory.theta_2_ref
    )
    return Point(WedgeBrake(), own, state_at(value, own), memory, stimulus)


LOOP = Loop(
    name="position",
    assembly="wedge-brake",
    summary="position control of the assembled wedge in its clearance, 5 kHz",
    at=Quantity("wedge travel", "m", 0.0),
    inputs=("theta_1_set", "theta_2_set"),
    output="theta_2",
    cut="i_2_ref",
    point=point,
    causes=CAUSES,
    band=(1.0, 150.0),
    amplitudes=(1e-3, 0.25, 0.5, 1.0),
    tunables={
        "control.position.f_n": (2.0, 200.0), "control.position.zeta": (0.2, 4.0),
        "control.position.c": (0.0, 1.0),
    },
    saturations=DRIVE_LIMITS,
    single=False,  # two motors share the load
)
