"""A quarter car with the wedge brake and a motor at its wheel, which recovers energy.

Slip control lowers the demanded moment, and the blending law shares what is left between motor and
brake. The brake's controllers follow the part that arrives over the bus.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

from annotated_types import Ge
from pydantic import model_validator

from bywire.brakes.wedge import control
from bywire.brakes.wedge.rigs import wedge_corner
from bywire.brakes.wedge.rigs.wedge_corner import WedgeCorner, WedgeCornerParameters
from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parameters import RuleError
from bywire.core.signals import Signal, joined
from bywire.vehicle import regeneration
from bywire.vehicle.regeneration import RegeneratingCorner

_CLEARLY = 0.9


class ElectricCornerParameters(WedgeCornerParameters):
    """The wedge brake on a quarter car, and its motor with battery and blending law."""

    regeneration: regeneration.Parameters

    @model_validator(mode="after")
    def _pads_stay_on_the_disc(self) -> ElectricCornerParameters:
        least, needed = self.regeneration.blending.T_least, self.ecu.M_least
        if self.ecu.abs != "off" and least < needed:
            reason = "slip control waits until the pads touch"
            valid = f">= ecu.M_least = {needed:g} N m"
            raise RuleError("regeneration.blending.T_least", f"{least:g} N m", valid, reason)
        return self


class Coast(NamedTuple):
    """Demand of the accelerator, in addition to that of the pedal."""

    T_coast: Annotated[float, Signal("N*m", "torque of the released accelerator", 50.0), Ge(0)]


Stimulus: Any = joined(__name__, "Stimulus", control.Stimulus, Coast)
"""demands of the wedge brake, whose moment pedal and motor share"""
Memory: Any = joined(__name__, "Memory", wedge_corner.Memory, regeneration.Memory)
"""memory of all controllers"""


class ElectricCorner(RegeneratingCorner[ElectricCornerParameters, Any], WedgeCorner):
    """The pedal's moment demand ``M_set`` is what motor and brake share."""

    name: ClassVar[str] = "wedge-corner-electric"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    turns: ClassVar[str] = "Omega"
    records: ClassVar[tuple[str, ...]] = (
        *WedgeCorner.records,
        "T_m",
        "T_m_ref",
        "T_limit",
        "T_friction",
        "T_brake",
        "soc",
        "E_recovered",
        "E_drive",
        "E_charged",
        "E_battery",
        "E_battery_loss",
    )

    def slip_acts(self, m: Any) -> float:
        """Return whether slip control lowers the demand by more than a tenth.

        At low speed, noise of the estimated slip lowers it by less for single samples.
        """
        return ops.where(m.M_left < _CLEARLY * m.M_most, 1.0, 0.0)

    def demands(self, m: Any, u: Any, par: ElectricCornerParameters) -> tuple[float, float]:
        """Return the demands of the pedal after slip control, and of the accelerator."""
        return super().demand(m, u, par), u.T_coast

    def demand(self, m: Any, u: Any, par: Any) -> float:
        """Return the moment that the blending law leaves to the brake [N m]."""
        left: float = m.T_brake
        return left

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return slip control of the whole demand, the blending law, and the brake's controllers.

        If slip control saw only the brake's part, it would take the end of the motor's torque for
        a demand that rises faster than the brake follows, and switch the motor off.
        """
        blending, *brake = super().tasks(par)
        above = [task for task in brake if task.name == "slip"]
        return (*above, blending, *(task for task in brake if task not in above))

    def rest(self, par: Any) -> tuple[Any, Any]:
        """Return the vehicle at rest with a parked brake."""
        return at_speed(0.0, par, 0.5)


def at_speed(v: float, par: ElectricCornerParameters, soc: float) -> tuple[Any, Any]:
    """Return the corner rolling at a speed [m/s] with a parked brake and a state of charge."""
    state, memory = wedge_corner.at_speed(v, par)
    held = memory._asdict() | regeneration.awake(v)
    return ElectricCorner.State(**state._asdict(), T_m=0.0, soc=soc), Memory(**held)
