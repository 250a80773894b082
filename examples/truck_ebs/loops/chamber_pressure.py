"""Loop of the chamber pressure, around the relay valve."""

from __future__ import annotations

from typing import cast

from bywire.authoring import Loop, LoopSchedule, ParameterSet, Point, Quantity
from truck_ebs.parameters import TruckParameters
from truck_ebs.rigs.brake_rig import BrakeRig
from truck_ebs.trim import held, leaking

_TOUCHING = {"ecu.pressure.touching.k_i": (0.1, 50.0)}
PRESSURE = Quantity("pressure", "Pa", 3e5)


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake that holds a pressure [Pa] against a small leak."""
    PRESSURE.require_positive(value)
    closed = cast(TruckParameters, par.replace({"ecu.control": "closed-loop"}))
    if not value < closed.p_s:
        limit = f"it must be < the pressure of the reservoir, p_s = {closed.p_s / 1e5:g} bar"
        raise PRESSURE.refused(value, limit)
    filling = leaking(value, closed)
    return Point(BrakeRig(), filling, *held(value, filling))


LOOP = Loop(
    name="chamber-pressure",
    assembly="truck-ebs",
    summary="pressure control at 200 Hz around the relay valve, while the feed seat is open",
    at=PRESSURE,
    inputs=("p_set",),
    output="p",
    cut="y_p",
    point=at,
    causes={
        "friction of the relay valve": {"relay.law": "lag"},
        "dead zone": {"ecu.pressure.p_dead": 0.0},
        "friction of rod and lever": {"lever.F_fr": 0.0, "lever.mu": 0.0},
    },
    band=(0.1, 10.0),
    amplitudes=(50.0, 500.0),
    tunables=_TOUCHING,
    schedule=LoopSchedule(
        changes={"ecu.control": "closed-loop"},
        borders=("ecu.pressure.p_touch",),
        regions={"gap": {"ecu.pressure.gap.k_i": (0.1, 50.0)}, "touching": _TOUCHING},
        main="touching",
        points=(0.34e5, 3e5),
    ),
    proof="ebs-response",
)
