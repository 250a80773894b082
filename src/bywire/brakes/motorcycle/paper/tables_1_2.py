"""Tables 1 and 2: parameters, transfer function (15), and changes that reconcile them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from bywire.brakes.motorcycle.linear import Rational, theoretical, two_pole_error
from bywire.brakes.motorcycle.paper.facts import FACTS, table2_model, table4_model
from bywire.brakes.motorcycle.paper.runs import BAR, MAIN, PRINTED, SETS, Runs, parameters
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import pipeline
from bywire.report.response_figures import Response, bode
from bywire.report.subject import parameter_rows
from bywire.report.tables import parameter_table
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, peak

P_NOMINAL = 20e5
"""assumed pressure at the nominal position x_mc [Pa]; the paper does not state it"""
_P_HARD = 37e5
"""highest pressure of Fig. 7a [Pa]"""


def table1(runs: Runs) -> Part:
    """Return the nominal position and the assumptions behind eqs. (11) and (12)."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        par = parameters(name)
        x = 1e3 * travel_at(P_NOMINAL, par)
        hard = runs.bench("hard-braking", name).recordings["run"]
        ratio = par.fluid.beta / _P_HARD
        items += [
            compared(
                f"table1.x_mc{suffix}",
                FACTS["table1.x_mc"],
                x,
                note="at 20 bar, a reading: x_rest is derived from it",
                tuned="calibrated",
            ),
            compared(
                f"table1.Re{suffix}",
                FACTS["re_laminar"],
                peak(hard, "Re"),
                note="largest Reynolds number during hard braking, Fig. 7a",
            ),
            compared(
                f"table1.eq11{suffix}",
                FACTS["eq11"],
                ratio,
                note="beta A_pd^2/(V_pd K_pd) = beta/p_pd at 37 bar; turns (10) into (11)",
            ),
        ]
    text = (
        "Table 1 gives most physical parameters. The paper does not print the piston's stroke "
        "s_mc, the seals' preload T_pr, the motor's winding, the controllers' gains and the pedal "
        "map. These are our choices, marked as such in the catalog."
    )
    appendix = {
        f"All parameters of {name}": parameter_table(
            parameter_rows(parameters(name), PARAMETER_SETS.find(name).values)
        )
        for name in SETS
    }
    title = "Table 1: parameters and assumptions"
    return Part(title, text, tuple(items), appendix=appendix)


# --- Table 2

_TWO_POLES_TO = 50.0
"""upper end of the band [Hz] for judging eq. (21): five times the required bandwidth"""


def _numbers(model: Rational) -> dict[str, float]:
    """Return gain [bar/A], zero and poles [Hz] of eq. (15) by the names of Table 2."""
    slow, fast, hydraulic = model.poles_hz
    return {
        "K": model.gain_bar,
        "zero": float(model.zeros_hz[0]),
        "pole1": float(slow),
        "pole2": float(fast),
        "pole3": float(hydraulic),
    }


def table2(runs: Runs) -> Part:
    """Return Table 2 from the calibrated and from the printed parameters."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        computed = _numbers(theoretical(parameters(name)))
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
        "Table 1 in eq. (15) does not give Table 2. A few plausible changes repair it: the "
        "calibrated set. It is tuned to Table 2, so its agreement proves only that such a set "
        "exists. The figure also shows Table 4's model, which the authors identified with dither."
    )
    return Part("Table 2: theoretical transfer function", text, tuple(items), (_figure(),))


def _two_poles() -> list[Item]:
    """Return the error of eq. (21) against eq. (15)."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        error = two_pole_error(parameters(name), high=_TWO_POLES_TO)
        note = (
            f"largest from 0 to {_TWO_POLES_TO:g} Hz: eq. (21) is (15) without zero and fast pole"
        )
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


# --- The repair


@dataclass(frozen=True)
class _Change:
    """A value of Table 1 that the calibrated set changes.

    ``name``: parameter; ``symbol``: its symbol in Table 1; ``unit``, ``factor``: unit at the edge,
    and how many of it one SI unit is.
    """

    name: str
    symbol: str
    unit: str
    factor: float


_CHANGES = (
    _Change("master_cylinder.A_mc", "A_mc", "mm**2", 1e6),
    _Change("gear.J_mot", "J_mot", "kg*m**2", 1.0),
    _Change("caliper.K_pd", "K_pd", "N/m", 1.0),
    _Change("pipeline.d_pl", "d_pl", "mm", 1e3),
    _Change("master_cylinder.s_mc", "s_mc", "mm", 1e3),
)


def repair(runs: Runs) -> Part:
    """Return the calibrated set's changes, the short stroke, and the laminar coefficient."""
    items = [_change(change) for change in _CHANGES]
    items += _short_stroke()
    items.append(_laminar(parameters(PRINTED)))
    text = (
        "The calibrated set changes five values, each as little and as plausibly as "
        "possible. The stroke alone cannot repair Table 1: s_mc moves only the fastest pole. "
        "A stroke that fits this pole to Table 2 lets the piston meet the chamber's end within "
        "the pressure sensor's range, and the other numbers stay wrong."
    )
    return Part("How Table 1 was repaired", text, tuple(items))


def _change(change: _Change) -> Item:
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
    """Return the stroke that gives Table 1 the fastest pole of Table 2, and its drawbacks."""
    printed = parameters(PRINTED)
    stated = FACTS["table2.pole3"].value

    def pole(s_mc: float) -> float:
        return _numbers(theoretical(_with_stroke(printed, s_mc)))["pole3"]

    nominal = printed.master_cylinder.x_nominal
    s_mc = float(brentq(lambda s: pole(s) - stated, nominal + 1e-4, nominal + 1e-2))
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
            "the range; not judged, because the stroke is only our trial",
        ),
    ]


def _with_stroke(par: MotorcycleParameters, s_mc: float) -> MotorcycleParameters:
    return par.replace({"master_cylinder.s_mc": s_mc, "master_cylinder.x_end": s_mc * (1.0 - 1e-6)})


def _rest(par: MotorcycleParameters) -> float:
    """Return the rest position [m] that gives 20 bar at the nominal position."""

    def excess(x_rest: float) -> float:
        moved = par.replace({"master_cylinder.x_rest": x_rest})
        return travel_at(P_NOMINAL, moved) - par.master_cylinder.x_nominal

    return float(brentq(excess, 1e-3, par.master_cylinder.x_nominal, xtol=1e-9))


def _laminar(par: MotorcycleParameters) -> Item:
    """Return the coefficient of the Hagen-Poiseuille law in the form of eq. (12)."""
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
