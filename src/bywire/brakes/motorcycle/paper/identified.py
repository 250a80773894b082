"""Table 4 as the paper got it: its two steps, on our nonlinear brake with dither."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from bywire.brakes.motorcycle.linear.brake import Rational, theoretical, with_slow_pair
from bywire.brakes.motorcycle.methods import braking_dynamics
from bywire.brakes.motorcycle.methods.braking.fit import five_of
from bywire.brakes.motorcycle.paper.facts import FACTS, REGIONS, table4_model
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, parameters
from bywire.identification.method import Effort, Identified
from bywire.report.response_figures import Response, bode
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit

SEED = 1
_KEYS = {"zero": "tau_L", "T1": "T1", "T2": "T2", "T_L": "T_L"}  # of Table 4, of eq. (22)


@cache
def identified(model: str) -> Identified:
    """Return what the experiment of section 5 gives on our brake.

    Parameters
    ----------
    model
        ``"eq-22"``, the paper's two steps from its starts, taken once as there; or ``"eq-21"``,
        without a slow pair, all records at once.
    """
    par = parameters(MAIN)
    p = REGIONS
    options = braking_dynamics.METHOD.defaults.replace(
        {
            "model": model,
            "fit": "two-step" if model == "eq-22" else "joint",
            "turns": 1,
            "p_low": p["low"],
            "p_medium": p["medium"],
            "p_high": p["high"],
            "i_step": FACTS["fig6_step"].value,
        }
    )
    method = braking_dynamics.METHOD
    return method.identify(method.synthetic(par, options, SEED), par, options, Effort())


def identified_model(region: str) -> Rational:
    """Return eq. (22) identified on our brake [Pa/A]."""
    return with_slow_pair(*five_of(identified("eq-22").estimates[region]).values())


def items() -> list[Item]:
    """Return Table 4 beside what its experiment gives on our brake."""
    rows: list[Item] = []
    for region in REGIONS:
        row, estimate = FACTS.table(f"table4.{region}"), identified("eq-22").estimates[region]
        five, prefix = five_of(estimate), f"table4.{region}.identified"
        deviation = {
            u.name: float(d) for u, d in zip(estimate.unknowns, estimate.deviations, strict=True)
        }
        rows.append(
            compared(
                f"{prefix}.K",
                row["K"],
                five["K"] / BAR,
                note=f"first step, {_interval(five['K'], deviation.get('K', math.nan))}: "
                "step of 0.35 A, nonlinear brake with dither and sensors' noise",
            )
        )
        for key, name in _KEYS.items():
            T = five[name]
            step = "second step, sines of 0.1 A" if key in ("T1", "T2") else "first step"
            if key == "T1":
                zero = 1.0 / (2.0 * math.pi * five["tau_L"])
                step += f"; the slow pair's zero at {zero:.3g} Hz nearly cancels it"
            rows.append(
                compared(
                    f"{prefix}.{key}",
                    row[key],
                    1.0 / (2.0 * math.pi * T),
                    note=f"{step}, {_interval(T, deviation.get(name, math.nan))}",
                )
            )
        rows += _without_pair(region)
    return rows


def _interval(value: float, deviation: float) -> str:
    return f"one standard deviation {100.0 * deviation / value:.2g} %"


def _without_pair(region: str) -> list[Item]:
    """Return the corners of eq. (21), which suffices for our brake."""
    five = five_of(identified("eq-21").estimates[region])
    note = "eq. (21) without a slow pair, fitted to step and sines at once"
    return [
        found(f"table4.{region}.eq21.K", "bar/A", five["K"] / BAR, note),
        found(f"table4.{region}.eq21.T1", "Hz", 1.0 / (2.0 * math.pi * five["T1"]), note),
        found(f"table4.{region}.eq21.T2", "Hz", 1.0 / (2.0 * math.pi * five["T2"]), note),
    ]


def exhibit() -> Exhibit:
    """Return the medium region's frequency response: measured, identified, theory, Table 4."""
    f = np.geomspace(0.02, 20.0, 300)
    gain, phase = (
        next(c.data for c in identified("eq-22").curves if c.name == f"medium-{part}")
        for part in ("gain", "phase")
    )
    measured = gain["measured"].values * np.exp(1j * np.radians(phase["measured"].values))
    responses = [
        Response("identified, our brake", f, identified_model("medium").response(f) / BAR),
        Response("Table 4, medium", f, table4_model("medium").response(f) / BAR),
        Response("eq. (15), calibrated", f, theoretical(parameters(MAIN)).response(f) / BAR),
        Response("sines, our brake", gain["frequency"].values, measured / BAR, measured=True),
    ]
    return Exhibit(
        "table4-identified",
        lambda: bode(responses, gain_unit="bar/A"),
        "Pressure over measured current at 25 bar: eq. (22) identified on our nonlinear "
        "brake by the paper's two steps (points: sines of 0.1 A), Table 4's medium "
        "model, and eq. (15).",
    )
