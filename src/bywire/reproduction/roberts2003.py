"""Roberts, Schautt, Hartmann, Gombert (2003), reproduced: Figs. 5 to 9, rigs, statements."""

from __future__ import annotations

from dataclasses import replace

from bywire.bench.running import Progress
from bywire.reproduction import (
    roberts2003_fig5,
    roberts2003_fig6,
    roberts2003_fig7,
    roberts2003_fig8,
    roberts2003_fig9,
    roberts2003_hold,
    roberts2003_motion,
    roberts2003_rigs,
    roberts2003_stability,
)
from bywire.reproduction.reproduction import Reproduction, Source
from bywire.reproduction.roberts2003_causes import causes
from bywire.reproduction.roberts2003_facts import CITATION
from bywire.reproduction.roberts2003_frequency_causes import causes as frequency_causes
from bywire.reproduction.roberts2003_runs import MAIN
from bywire.reproduction.roberts2003_tolerances import ALLOWANCES
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
