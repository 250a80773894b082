"""Contract of a model's energies: a run gives what was put in, to losses and to what is stored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bywire.bench.energy_ledger import Ledger, actuator_ledger
from bywire.bench.recording import record
from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.trial import LARGE, Trial
from bywire.simulation.run import Run, simulate

RESIDUAL = 1e-6
"""of the energy that is turned over: what may be left once the step's own error is taken off"""
SHARES = (LARGE, 0.05)


def closes_its_energy(trial: Trial) -> Iterator[Evidence]:
    """Find whether the recorded energies of a large and of a small run close.

    The step's own error falls with its square: of the residuals at two steps the difference tells
    it, and it is taken off.
    """
    place = trial.place("powers", "power")
    for share in SHARES:
        run = trial.start.run(share)
        coarse, fine = (_ledger(replace(run, step=run.step / n)) for n in (1, 2))
        if not fine.turnover:
            raise NotCheckedError(
                f"the recording shows no energies (E_source, losses E_..., E_stored) that change "
                f"in a run from {trial.start.known}"
            )
        left = (4.0 * fine.closing_error - coarse.closing_error) / 3.0 / fine.turnover
        size = "large" if share == LARGE else "small"
        text = f"{abs(left):.1e} of the {fine.turnover:.3g} J of a {size} run are unexplained"
        yield measured(abs(left), RESIDUAL, text, place)


def _ledger(run: Run) -> Ledger:
    return actuator_ledger(record(run, simulate(run), 0.0, 0.0, {}))
