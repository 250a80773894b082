"""Table 3 and Fig. 4: the friction model, and eq. (19)'s dither amplitude."""

from __future__ import annotations

import numpy as np

from bywire.brakes.motorcycle.paper import facts
from bywire.brakes.motorcycle.paper import friction as dardanelli2010_friction
from bywire.brakes.motorcycle.paper.runs import MAIN, Runs, parameters
from bywire.brakes.motorcycle.paper.tolerances import ABOUT, PRINTED
from bywire.control import dither
from bywire.plant import ball_screw_gear, seal_friction
from bywire.report.stribeck_curve import stribeck_curve
from bywire.reproduction.item import Fact, Item, compared
from bywire.reproduction.reproduction import Exhibit, Part

P_EQ19 = 25e5
"""pressure at which eq. (19) is checked [Pa], that of Fig. 6"""


def part(runs: Runs) -> Part:
    """Return the friction parameters in use, Fig. 4's extremes, and two disagreements."""
    par = parameters(MAIN)
    used = par.seal.flat()
    items: list[Item] = [
        compared(f"table3.{name}", fact, used[name], None, "used as published", tuned="an input")
        for name, fact in facts.TABLE3.items()
    ]
    curve = runs.bench("stribeck", MAIN).recordings["curve"]
    torque = curve["T_fr"].values
    bare = par.seal.k_brk_p * par.seal.f_cfr_p * float(curve["p_mc"].values[-1])
    items += [
        compared(
            "fig4.top_tick", facts.FIG4_TOP, float(np.max(torque)), "<=",
            f"breakaway torque at 40 bar from Table 3 with T_pr = {par.seal.T_pr:g} N m, chosen; "
            f"{bare:.3g} N m even without it: the curves are not those of the printed values",
        ),
        compared(
            "fig4.bottom_tick", facts.FIG4_BOTTOM, float(np.min(torque)), ">=",
            "release side at 40 bar",
        ),
        _viscous(par.seal.mu_T / par.gear.k_g),
        _eq19(),
        *dardanelli2010_friction.items(),
    ]  # fmt: skip
    text = (
        "Table 3 is used as published; only the preload T_pr, which it omits, is ours. Where the "
        "curves are vertical the piston sticks: the torque is anything between both ends."
    ) + dardanelli2010_friction.text()
    exhibit = Exhibit(
        "fig4", stribeck_curve(curve), "Fig. 4: friction torque at the motor shaft over speed."
    )
    return Part("Table 3 and Figure 4: friction", text, tuple(items),
                (exhibit, dardanelli2010_friction.exhibit()))  # fmt: skip


def _viscous(mu_F: float) -> Item:
    """Return the viscous coefficient of the text against that of Table 3."""
    return compared(
        "section3.mu", facts.MU_TEXT, mu_F, ABOUT.around(facts.MU_TEXT.value),
        "one effect, two values: Table 3's torque per shaft speed mu_T gives the force per shaft "
        "speed mu_F = mu_T/k_g; either is negligible beside k_damp; the models use Table 3's",
    )  # fmt: skip


def _eq19() -> Item:
    """Return the current that breaks the piston away by eq. (8) against eq. (19)'s."""
    bare = {"seal.T_pr": 0.0, "ecu.est_par.T_pr": 0.0}  # not printed
    par = parameters(MAIN).replace(bare)
    seal = seal_friction.output(seal_friction.Input(0.0, P_EQ19), par.seal)
    bounds = ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, 0.0, par.gear)
    needed = -bounds.low / (par.gear.eta_g * par.motor.K_e)
    stated = dither.breakaway_current(P_EQ19, par.ecu.est_par)
    return compared(
        "eq19.A_dit", Fact(stated, "A", "eq. (19) at 25 bar with Tables 1 and 3, T_pr = 0"),
        needed, PRINTED.around(stated),
        "current above the holding current that eq. (8) needs to break away: (19) leaves eta_g out",
    )  # fmt: skip
