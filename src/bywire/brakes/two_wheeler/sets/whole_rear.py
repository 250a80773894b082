"""The sport motorcycle with the whole brake of Dardanelli et al. (2010) at its rear wheel."""

from __future__ import annotations

from bywire.brakes.motorcycle.sets import dardanelli2010
from bywire.brakes.two_wheeler.parameters import WholeRearParameters
from bywire.brakes.two_wheeler.sets import sport600
from bywire.core.catalog import CitedSet

_BRAKE = next(e for e in dardanelli2010.ENTRIES if e.name == "dardanelli2010-retuned")

WHOLE_REAR = CitedSet(
    name="sport600-whole-rear",
    assembly="two-wheeler-whole-rear",
    source=f"{sport600.FILE.citation}; all of the rear brake: {dardanelli2010.FILE.citation}",
    summary="the sport motorcycle, its rear brake that of dardanelli2010-retuned",
    parameter_class=WholeRearParameters,
    values={
        **{
            name: value
            for name, value in sport600.SPORT600.values.items()
            if not name.startswith("rear.circuit.")
        },
        **{
            f"rear.actuator.{name}": value.moved_to({"": "rear.actuator"})
            for name, value in _BRAKE.values.items()
        },
    },
)
