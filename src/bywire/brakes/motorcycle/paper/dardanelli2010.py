"""Dardanelli, Alli, Savaresi (2010), reproduced: Tables 1 to 4, Figs. 3 to 7, disagreements."""

from __future__ import annotations

from bywire.brakes.motorcycle.paper import (
    dither,
    fig3,
    fig5,
    fig6,
    fig7,
    gear,
    repair,
    requirements,
    table1,
    table2,
    table3,
    table4,
)
from bywire.brakes.motorcycle.paper.causes import causes
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, CITATION
from bywire.brakes.motorcycle.paper.runs import MAIN, Runs
from bywire.reproduction.reproduction import Reproduction, Source, reproduced

PARTS = {
    "Table 1": table1.part,
    "Table 2": table2.part,
    "repair of Table 1": repair.part,
    "Table 3, Fig. 4": table3.part,
    "Fig. 3": fig3.part,
    "Fig. 5": fig5.part,
    "waveforms": dither.part,
    "Table 4": table4.part,
    "Fig. 6": fig6.part,
    "Fig. 7": fig7.part,
    "requirements": requirements.part,
    "gear": gear.part,
}
NAMES = {
    "": "Calibrated set, and what needs no set",
    "table1": "Table 1 as printed (ids with @table1)",
    "retuned": "Gains retuned on the bench (ids with @retuned)",
}
"""parameter sets, by what follows @ in an item's id"""

SOURCE = Source(
    name=MAIN,
    summary="electro-mechanical brake-by-wire actuator for a sport motorbike, IFAC 2010",
    reproduce=lambda progress: reproduced(
        Reproduction(MAIN, CITATION, allowances=tuple(ALLOWANCES.values()), sets=NAMES),
        Runs(progress),
        PARTS,
        causes,
    ),
)
reproduce = SOURCE.reproduce
