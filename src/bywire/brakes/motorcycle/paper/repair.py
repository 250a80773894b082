"""What it takes to make Table 1 give Table 2, and eq. (12)'s laminar coefficient."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from bywire.brakes.motorcycle.linear.brake import theoretical
from bywire.brakes.motorcycle.paper.facts import FACTS
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, PRINTED, Runs, parameters
from bywire.brakes.motorcycle.paper.table1 import P_NOMINAL
from bywire.brakes.motorcycle.paper.table2 import numbers
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import pipeline
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Part


@dataclass(frozen=True)
class Change:
    """A value of Table 1 that the calibrated set changes.

    ``name``: parameter; ``symbol``: its symbol in Table 1; ``unit``, ``factor``: unit at the edge,
    and how many of it one SI unit is.
    """

    name: str
    symbol: str
    unit: str
    factor: float


CHANGES = (
    Change("master_cylinder.A_mc", "A_mc", "mm**2", 1e6),
    Change("gear.J_mot", "J_mot", "kg*m**2", 1.0),
    Change("caliper.K_pd", "K_pd", "N/m", 1.0),
    Change("pipeline.d_pl", "d_pl", "mm", 1e3),
    Change("master_cylinder.s_mc", "s_mc", "mm", 1e3),
)


def part(runs: Runs) -> Part:
    """Return the calibrated set's changes, the short stroke, and the laminar coefficient."""
    items = [_change(change) for change in CHANGES]
    items += _short_stroke()
    items.append(_laminar(parameters(PRINTED)))
    text = (
        "Five values are changed in the calibrated set, each as little and as plausibly as "
        "possible. A stroke alone cannot repair Table 1: s_mc moves the fastest pole only, and "
        "where that one fits Table 2 the piston meets the chamber's end within the pressure "
        "sensor's range, and the other numbers stay wrong."
    )
    return Part("How Table 1 was repaired", text, tuple(items))


def _change(change: Change) -> Item:
    """Return the old and the new value of a parameter, with the reason."""
    cited = PARAMETER_SETS.find(MAIN).values[change.name]
    new, name = change.factor * float(cited.value), f"calibrated.{change.symbol}"
    if change.symbol not in FACTS.table("table1"):
        return found(name, change.unit, new, f"calibrated; not printed; {cited.where}")
    fact = FACTS.table("table1")[change.symbol]
    share = new / fact.value
    note = f"{share:.3g} times the printed value, our change; {cited.where}"
    return compared(name, fact, new, None, note, tuned="calibrated")


def _short_stroke() -> list[Item]:
    """Return the stroke that gives Table 1 the fastest pole of Table 2, and what it costs."""
    printed = parameters(PRINTED)
    wanted = FACTS["table2.pole3"].value

    def pole(s_mc: float) -> float:
        return numbers(theoretical(_with_stroke(printed, s_mc)))["pole3"]

    nominal = printed.master_cylinder.x_nominal
    s_mc = float(brentq(lambda s: pole(s) - wanted, nominal + 1e-4, nominal + 1e-2))
    par = _with_stroke(printed, s_mc)
    par = par.replace({"master_cylinder.x_rest": _rest(par)})
    p_end = float(brentq(lambda p: travel_at(p, par) - s_mc, P_NOMINAL, 60e5))
    return [
        found("short_stroke.s_mc", "mm", 1e3 * s_mc, "gives Table 1 in (15) the pole 3 of Table 2"),
        compared(
            "short_stroke.pole3",
            FACTS["table2.pole3"],
            pole(s_mc),
            note="Table 1 with that stroke",
            tuned="calibrated",
        ),
        compared(
            "short_stroke.p_end",
            FACTS["sensor_range"],
            p_end / BAR,
            note="pressure at which the piston meets the chamber's end with that stroke: within "
            "the range; not judged, the stroke is a trial of ours",
        ),
    ]


def _with_stroke(par: MotorcycleParameters, s_mc: float) -> MotorcycleParameters:
    return par.replace({"master_cylinder.s_mc": s_mc, "master_cylinder.x_end": s_mc * (1.0 - 1e-6)})


def _rest(par: MotorcycleParameters) -> float:
    """Return the rest position from which 20 bar are reached at the nominal position [m]."""

    def excess(x_rest: float) -> float:
        moved = par.replace({"master_cylinder.x_rest": x_rest})
        return travel_at(P_NOMINAL, moved) - par.master_cylinder.x_nominal

    return float(brentq(excess, 1e-3, par.master_cylinder.x_nominal, xtol=1e-9))


def _laminar(par: MotorcycleParameters) -> Item:
    """Return the coefficient that Hagen and Poiseuille's law has in the form of eq. (12)."""
    d, nu, rho = par.pipeline.d_pl, par.fluid.nu, par.fluid.rho
    textbook = 128.0 * nu * rho * par.pipeline.L_pl / (math.pi * d**4)
    coefficient = par.pipeline.k_lf * textbook / pipeline.resistance(par.pipeline, par.fluid)
    return compared(
        "laminar.coefficient",
        FACTS["k_lf"],
        coefficient,
        note="128 nu rho L/(pi d^4) of Hagen and Poiseuille, written as k nu rho pi L/A^2: "
        "a quarter; the models use the paper's",
    )
