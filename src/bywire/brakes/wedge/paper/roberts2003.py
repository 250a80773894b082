"""Roberts, Schautt, Hartmann, Gombert (2003), reproduced: Figs. 5 to 9, rigs, statements."""

from __future__ import annotations

from dataclasses import replace

from bywire.bench.running import Progress
from bywire.brakes.wedge.paper import fig5 as roberts2003_fig5
from bywire.brakes.wedge.paper import fig6 as roberts2003_fig6
from bywire.brakes.wedge.paper import fig7 as roberts2003_fig7
from bywire.brakes.wedge.paper import fig8 as roberts2003_fig8
from bywire.brakes.wedge.paper import fig9 as roberts2003_fig9
from bywire.brakes.wedge.paper import hold as roberts2003_hold
from bywire.brakes.wedge.paper import motion as roberts2003_motion
from bywire.brakes.wedge.paper import rigs as roberts2003_rigs
from bywire.brakes.wedge.paper import stability as roberts2003_stability
from bywire.brakes.wedge.paper.causes import causes
from bywire.brakes.wedge.paper.facts import CITATION
from bywire.brakes.wedge.paper.frequency_causes import causes as frequency_causes
from bywire.brakes.wedge.paper.runs import MAIN
from bywire.brakes.wedge.paper.tolerances import ALLOWANCES
from bywire.reproduction.reproduction import Reproduction, Source
from bywire.reproduction.runs import Runs

PARTS = {
    "neutral point": roberts2003_stability.part,
    "current loop": roberts2003_rigs.current_loop,
    "efficiency": roberts2003_rigs.efficiency,
    "stiffness": roberts2003_rigs.stiffness,
    "Fig. 5": roberts2003_fig5.part,
    "Fig. 6": roberts2003_fig6.part,
    "position": roberts2003_motion.position,
    "force fight": roberts2003_motion.force_fight,
    "Fig. 7": roberts2003_fig7.part,
    "Fig. 8": roberts2003_fig8.part,
    "Fig. 9": roberts2003_fig9.part,
    "holding": roberts2003_hold.part,
}


def reproduce(progress: Progress | None = None) -> Reproduction:
    """Reproduce frequency responses, braking tests, rigs and the statements of the text.

    Parameters
    ----------
    progress
        Called with the label of a figure or test and its finished share, 0 to 1.

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
    found = Reproduction(
        MAIN, CITATION, tuple(parts), allowances=ALLOWANCES, sets={"": "Our parameter set"}
    )
    known = (*causes(found.items), *frequency_causes(found.items))
    return replace(found, causes=known)


SOURCE = Source(
    name=MAIN,
    summary="self-reinforcing wedge brake with two motors, SAE 2003",
    reproduce=reproduce,
)
