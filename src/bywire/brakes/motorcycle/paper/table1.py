"""Table 1 and what can be checked of it (section 3 of Dardanelli et al. 2010)."""

from __future__ import annotations

from bywire.brakes.motorcycle.paper.facts import FACTS
from bywire.brakes.motorcycle.paper.runs import SETS, Runs, parameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.catalog import PARAMETER_SETS
from bywire.report.subject import parameter_rows
from bywire.report.tables import parameter_table
from bywire.reproduction.item import Item, compared
from bywire.reproduction.reproduction import Part
from bywire.reproduction.runs import peak

P_NOMINAL = 20e5
"""pressure taken for the nominal position x_mc [Pa]; the paper names none"""
P_HARD = 37e5
"""highest pressure of Fig. 7a [Pa]"""


def part(runs: Runs) -> Part:
    """Return the nominal position and the assumptions behind eqs. (11) and (12)."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        par = parameters(name)
        x = 1e3 * travel_at(P_NOMINAL, par)
        hard = runs.bench("hard-braking", name).recordings["run"]
        ratio = par.fluid.beta / P_HARD
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
                note="beta A_pd^2/(V_pd K_pd) = beta/p_pd at 37 bar, by which (10) becomes (11)",
            ),
        ]
    text = (
        "Table 1 gives most physical parameters. Not printed are the piston's stroke s_mc, the "
        "seals' preload T_pr, the motor's winding, the controllers' gains and the pedal map: "
        "these are our choices, marked as such in the catalog."
    )
    appendix = {
        f"All parameters of {name}": parameter_table(
            parameter_rows(parameters(name), PARAMETER_SETS.find(name).values)
        )
        for name in SETS
    }
    title = "Table 1: parameters and assumptions"
    return Part(title, text, tuple(items), appendix=appendix)
