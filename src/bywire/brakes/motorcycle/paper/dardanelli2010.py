"""Dardanelli, Alli, Savaresi (2010), reproduced: Tables 1 to 4, Figs. 3 to 7, disagreements."""

from __future__ import annotations

from dataclasses import replace

from bywire.bench.running import Progress
from bywire.brakes.motorcycle.paper import dither as dardanelli2010_dither
from bywire.brakes.motorcycle.paper import fig3 as dardanelli2010_fig3
from bywire.brakes.motorcycle.paper import fig5 as dardanelli2010_fig5
from bywire.brakes.motorcycle.paper import fig6 as dardanelli2010_fig6
from bywire.brakes.motorcycle.paper import fig7 as dardanelli2010_fig7
from bywire.brakes.motorcycle.paper import gear as dardanelli2010_gear
from bywire.brakes.motorcycle.paper import repair as dardanelli2010_repair
from bywire.brakes.motorcycle.paper import requirements as dardanelli2010_requirements
from bywire.brakes.motorcycle.paper import table1 as dardanelli2010_table1
from bywire.brakes.motorcycle.paper import table2 as dardanelli2010_table2
from bywire.brakes.motorcycle.paper import table3 as dardanelli2010_table3
from bywire.brakes.motorcycle.paper import table4 as dardanelli2010_table4
from bywire.brakes.motorcycle.paper.causes import causes
from bywire.brakes.motorcycle.paper.facts import CITATION
from bywire.brakes.motorcycle.paper.runs import MAIN, Runs
from bywire.brakes.motorcycle.paper.tolerances import ALLOWANCES
from bywire.reproduction.reproduction import Reproduction, Source

PARTS = {
    "Table 1": dardanelli2010_table1.part,
    "Table 2": dardanelli2010_table2.part,
    "repair of Table 1": dardanelli2010_repair.part,
    "Table 3, Fig. 4": dardanelli2010_table3.part,
    "Fig. 3": dardanelli2010_fig3.part,
    "Fig. 5": dardanelli2010_fig5.part,
    "waveforms": dardanelli2010_dither.part,
    "Table 4": dardanelli2010_table4.part,
    "Fig. 6": dardanelli2010_fig6.part,
    "Fig. 7": dardanelli2010_fig7.part,
    "requirements": dardanelli2010_requirements.part,
    "gear": dardanelli2010_gear.part,
}

NAMES = {
    "": "Calibrated set, and what needs no set",
    "table1": "Table 1 as printed (ids with @table1)",
    "retuned": "Gains retuned on the bench (ids with @retuned)",
}
"""parameter sets, by what follows @ in an item's id"""


def reproduce(progress: Progress | None = None) -> Reproduction:
    """Reproduce every table and figure.

    Parameters
    ----------
    progress
        Called with the label of a table or figure and its finished share, 0 to 1.

    Raises
    ------
    RunError
        When a run fails.
    """
    runs = Runs(progress)
    parts = []
    for label, part in PARTS.items():
        runs.report(label, 0.0)
        parts.append(part(runs))
        runs.report(label, 1.0)
    found = Reproduction(MAIN, CITATION, tuple(parts), allowances=ALLOWANCES, sets=NAMES)
    return replace(found, causes=causes(found.items))


SOURCE = Source(
    name=MAIN,
    summary="electro-mechanical brake-by-wire actuator for a sport motorbike, IFAC 2010",
    reproduce=reproduce,
)
