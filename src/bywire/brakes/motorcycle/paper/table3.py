"""Table 3 and Fig. 4: the friction model, and eq. (19)'s dither amplitude."""

from __future__ import annotations

from functools import cache

import numpy as np

from bywire.brakes.motorcycle.methods import friction_ramp
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, FACTS
from bywire.brakes.motorcycle.paper.runs import MAIN, Runs, parameters
from bywire.control import dither
from bywire.identification.method import Effort, Identified
from bywire.plant import ball_screw_gear, seal_friction
from bywire.report.estimate_figures import method_curve
from bywire.report.friction_figures import stribeck_curve
from bywire.reproduction.item import Fact, Item, compared
from bywire.reproduction.reproduction import Exhibit, Part

P_EQ19 = 25e5
"""pressure at which eq. (19) is checked [Pa], that of Fig. 6"""
SEED = 1
OFF = {"k_brk_p": 0.9, "f_cfr_p": 0.8, "c": 1.2, "f_cfr_n": 1.2, "k_brk_n": 1.1, "T_pr": 1.2}
"""starts of the search, relative to the true values"""


def part(runs: Runs) -> Part:
    """Return the friction parameters in use, Fig. 4's extremes, and two disagreements."""
    par = parameters(MAIN)
    used = par.seal.flat()
    items: list[Item] = [
        compared(f"table3.{name}", fact, used[name], None, "used as published", tuned="an input")
        for name, fact in FACTS.table("table3").items()
    ]
    curve = runs.bench("seal-stribeck", MAIN).recordings["curve"]
    torque = curve["T_fr"].values
    bare = par.seal.k_brk_p * par.seal.f_cfr_p * float(curve["p_mc"].values[-1])
    items += [
        compared(
            "fig4.top_tick",
            FACTS["fig4_top"],
            float(np.max(torque)),
            note=f"breakaway torque at 40 bar from Table 3 with T_pr = {par.seal.T_pr:g} N m, "
            f"chosen; {bare:.3g} N m even without it: the curves are not those of the printed "
            "values",
        ),
        compared(
            "fig4.bottom_tick",
            FACTS["fig4_bottom"],
            float(np.min(torque)),
            note="release side at 40 bar",
        ),
        _viscous(par.seal.mu_T / par.gear.k_g),
        _eq19(),
        *_identified_items(),
    ]
    text = (
        "We use Table 3 as published; only the preload T_pr, which it omits, is ours. Where the "
        "curves are vertical, the piston sticks: the torque is anywhere between both ends."
    ) + _undetermined()
    exhibit = Exhibit(
        "fig4",
        lambda: stribeck_curve(curve),
        "Fig. 4: friction torque at the motor shaft over speed.",
    )
    return Part(
        "Table 3 and Figure 4: friction", text, tuple(items), (exhibit, _identified_exhibit())
    )


def _viscous(mu_F: float) -> Item:
    """Return the viscous coefficient of the text against that of Table 3."""
    return compared(
        "section3.mu",
        FACTS["mu_text"],
        mu_F,
        note="one effect, two values: Table 3's "
        "torque per shaft speed mu_T gives the force per shaft speed mu_F = mu_T/k_g; "
        "either is negligible beside k_damp; the models use Table 3's",
    )


def _eq19() -> Item:
    """Return the breakaway current by eq. (8), against eq. (19)'s."""
    bare = {"seal.T_pr": 0.0, "ecu.est_par.T_pr": 0.0}  # not printed
    par = parameters(MAIN).replace(bare)
    seal = seal_friction.output(seal_friction.Input(0.0, P_EQ19), par.seal)
    bounds = ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, 0.0, par.gear)
    needed = -bounds.low / (par.gear.eta_g * par.motor.K_e)
    stated = dither.breakaway_current(P_EQ19, par.ecu.est_par)
    return compared(
        "eq19.A_dit",
        Fact(stated, "A", "eq. (19) at 25 bar with Tables 1 and 3, T_pr = 0"),
        needed,
        ALLOWANCES["printed"],
        "current above the holding current for breakaway by eq. (8): eq. (19) omits eta_g",
    )


@cache
def _identified() -> Identified:
    """Return the friction identified from a simulated ramp (17), with a start off the truth."""
    par = parameters(MAIN)
    seal = par.seal.flat()
    start = par.replace({f"seal.{name}": share * seal[name] for name, share in OFF.items()})
    options = friction_ramp.METHOD.defaults
    data = friction_ramp.METHOD.synthetic(par, options, SEED)
    return friction_ramp.METHOD.identify(data, start, options, Effort(starts=1))


def _identified_items() -> list[Item]:
    """Return the estimates against Table 3's values, the truth of the simulation."""
    estimate = _identified().estimates["seal friction"]
    ends = dict(zip(estimate.names, estimate.intervals().tolist(), strict=True))
    rows: list[Item] = []
    for name, fact in FACTS.table("table3").items():
        label = f"seal.{name}"
        if label not in ends:
            continue
        low, high = ends[label]
        rows.append(
            compared(
                f"table3.identified.{name}",
                fact,
                estimate[label],
                None,
                "identified from our own ramp, simulated with this value; 95 % interval "
                f"{low:.4g} to {high:.4g}; the search started "
                f"{100.0 * (OFF[name] - 1.0):+.0f} % off",
            )
        )
    return rows


def _undetermined() -> str:
    """Return a sentence on the parameters that the ramp does not determine."""
    kept = _identified().estimates["seal friction"].kept
    if not kept:
        return ""
    names = " and ".join(k.unknown.name.removeprefix("seal.") for k in kept)
    return f" The ramp of eq. (17), identified on our own brake, does not determine {names}."


def _identified_exhibit() -> Exhibit:
    """Return Fig. 4 as identified, with its confidence bands."""
    curve = next(c for c in _identified().curves if c.name == "stribeck")
    widest = float((curve.data["high"] - curve.data["value"]).max())
    return Exhibit(
        "fig4-identified",
        lambda: method_curve(curve),
        "Fig. 4 as identified on our own brake from one ramp with sensor noise; "
        f"bands: 95 % confidence, {widest:.1g} N m to either side at most.",
    )
