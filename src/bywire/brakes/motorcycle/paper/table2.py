"""Table 2: gain, zero and poles of the theoretical transfer function (15)."""

from __future__ import annotations

import numpy as np

from bywire.brakes.motorcycle.linear.brake import Rational, theoretical, two_pole_error
from bywire.brakes.motorcycle.paper.facts import FACTS, table2_model, table4_model
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, PRINTED, SETS, Runs, parameters
from bywire.report.response_figures import Response, bode
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part

TWO_POLES_TO = 50.0
"""end of the band [Hz] over which eq. (21) is judged: five times the required bandwidth"""


def numbers(model: Rational) -> dict[str, float]:
    """Return gain [bar/A], zero and poles [Hz] of eq. (15) by the names of Table 2."""
    slow, fast, hydraulic = model.poles_hz
    return {
        "K": model.gain_bar,
        "zero": float(model.zeros_hz[0]),
        "pole1": float(slow),
        "pole2": float(fast),
        "pole3": float(hydraulic),
    }


def part(runs: Runs) -> Part:
    """Return Table 2 from the calibrated and from the printed parameters."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        computed = numbers(theoretical(parameters(name)))
        for key, fact in FACTS.table("table2").items():
            note = "s_mc, which moves it, is not printed" if key == "pole3" else ""
            items.append(
                compared(
                    f"table2.{key}{suffix}",
                    fact,
                    computed[key],
                    note=f"Table 1 in (15){'; ' if note else ''}{note}" if suffix else "",
                    tuned="" if suffix else "calibrated",
                )
            )
    items += _two_poles()
    text = (
        "Table 1 put into eq. (15) does not give Table 2. Few plausible changes repair it: the "
        "calibrated set, tuned to Table 2, so that its agreement proves nothing but that such a "
        "set exists. The figure also shows Table 4's model, identified by the authors with dither."
    )
    return Part("Table 2: theoretical transfer function", text, tuple(items), (_figure(),))


def _two_poles() -> list[Item]:
    """Return what eq. (21) leaves out of eq. (15)."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        error = two_pole_error(parameters(name), high=TWO_POLES_TO)
        note = f"largest from 0 to {TWO_POLES_TO:g} Hz: eq. (21) is (15) without zero and fast pole"
        items += [
            found(f"eq21.gain_error{suffix}", "dB", error.gain, note),
            found(f"eq21.phase_error{suffix}", "deg", error.phase, note),
        ]
    return items


def _figure() -> Exhibit:
    f = np.geomspace(0.02, 500.0, 400)
    models = {
        "eq. (15), Table 1": theoretical(parameters(PRINTED)),
        "eq. (15), calibrated": theoretical(parameters(MAIN)),
        "Table 4, medium pressure": table4_model("medium"),
    }
    responses = [Response(label, f, model.response(f) / BAR) for label, model in models.items()]
    sparse = f[::20]
    responses.append(
        Response("Table 2 as printed", sparse, table2_model().response(sparse) / BAR, measured=True)
    )
    return Exhibit(
        "table2-bode",
        lambda: bode(responses, gain_unit="bar/A"),
        "Pressure over motor current: eq. (15) from the two parameter sets, the "
        "transfer function that Table 2 prints (points), and Table 4's model.",
    )
