"""Strathmann and Oehlerking (2015): the linear benchmark and its property."""

from __future__ import annotations

from bywire.authoring import (
    Progress,
    Reproduction,
    Runs,
    Source,
    SourcePart,
    compared,
    kpis,
    linearize,
    parameters,
)
from emb_caliper.paper import facts
from emb_caliper.rigs.approach import Approach, at_rest
from emb_caliper.sets.strathmann2015 import SOURCE as CITATION

MAIN = "strathmann2015"
_EXACT = 1e-6


def reproduce(progress: Progress | None = None) -> Reproduction:
    """Compute the current pole and the pad travel at both ends of the interval."""
    runs = Runs(progress)
    runs.report("approach", 0.0)
    state, memory = at_rest()
    plant = linearize(Approach(), parameters(MAIN), state, memory, inputs=("x_e",), outputs=("x",))
    items = [compared("current.pole", facts.POLE, float(min(plant.A.diagonal())), _EXACT)]
    for rate in (501.0, 504.0, 507.0):
        # (R + K^2 / d) / L is the rate; K^2 / d is 4 mohm.
        R = {"motor.R_m": rate * 1e-3 - 4e-3}
        x_max = kpis(runs.bench("approach", MAIN, R))["x_max"]
        items.append(
            compared(
                f"approach.x_max_{rate:g}",
                facts.TOUCH,
                10.0 * x_max,
                "<=",
                f"current coefficient -{rate:g} 1/s",
            )
        )
    runs.report("approach", 1.0)
    text = "The sampling is exactly as stated. The simulation step is a fifth of the sample time."
    part = SourcePart("Closing the clearance", text, tuple(items))
    return Reproduction(MAIN, CITATION, (part,), sets={"": "The benchmark"})


SOURCE = Source(
    name=MAIN,
    summary="linear benchmark of an EMB that closes its clearance, ARCH 2015",
    reproduce=reproduce,
)
