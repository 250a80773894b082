"""Roberts, Schautt, Hartmann, Gombert (2003), reproduced: Figs. 5 to 9, rigs, statements."""

from __future__ import annotations

from bywire.brakes.wedge.paper import fig5, fig6, fig7, fig8, fig9, hold, motion, rigs, stability
from bywire.brakes.wedge.paper.causes import causes
from bywire.brakes.wedge.paper.facts import ALLOWANCES, CITATION
from bywire.brakes.wedge.paper.runs import MAIN
from bywire.reproduction.reproduction import Reproduction, Runs, Source, reproduced

PARTS = {
    "neutral point": stability.part,
    "current loop": rigs.current_loop,
    "efficiency": rigs.efficiency,
    "stiffness": rigs.stiffness,
    "Fig. 5": fig5.part,
    "Fig. 6": fig6.part,
    "position": motion.position,
    "force fight": motion.force_fight,
    "Fig. 7": fig7.part,
    "Fig. 8": fig8.part,
    "Fig. 9": fig9.part,
    "holding": hold.part,
}

SOURCE = Source(
    name=MAIN,
    summary="self-reinforcing wedge brake with two motors, SAE 2003",
    reproduce=lambda progress: reproduced(
        Reproduction(
            MAIN, CITATION, allowances=tuple(ALLOWANCES.values()), sets={"": "Our parameter set"}
        ),
        Runs(progress),
        PARTS,
        causes,
    ),
)
reproduce = SOURCE.reproduce
