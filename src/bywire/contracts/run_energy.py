"""Contract of a model's energies: a run gives what was put in, to losses and to what is stored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bywire.bench.energy_ledger import Ledger, actuator_ledger, further_ledgers
from bywire.bench.recording import record
from bywire.contracts.evidence import Evidence, NotCheckedError, measured
from bywire.contracts.trial import LARGE, Trial
from bywire.simulation.run import Run, simulate

RESIDUAL = 1e-6
"""of the energy that is turned over: what may be left once the step's own error is taken off"""
SHARES = (LARGE, 0.05)


def closes_its_energy(trial: Trial) -> Iterator[Evidence]:
    """Find whether the recorded energies of a large and of a small run close, book by book.

    The step's own error falls with its square: of the residuals at two steps the difference tells
    it, and it is taken off.
    """
    place = trial.place("powers", "power")
    for share in SHARES:
        run = trial.start.run(share)
        coarse, fine = (_ledgers(replace(run, step=run.step / n)) for n in (1, 2))
        turned = {book: each for book, each in fine.items() if each.turnover}
        if not turned:
            raise NotCheckedError(
                f"the recording shows no energies (E_source, losses E_..., E_stored) that change "
                f"in a run from {trial.start.known}"
            )
        size = "large" if share == LARGE else "small"
        for book, each in turned.items():
            before = coarse[book].closing_error if book in coarse else each.closing_error
            left = (4.0 * each.closing_error - before) / 3.0 / each.turnover
            where = f", in the book {book!r}" if book else ""
            text = (
                f"{abs(left):.1e} of the {each.turnover:.3g} J of a {size} run are unexplained"
                + where
            )
            yield measured(abs(left), RESIDUAL, text, place)


def _ledgers(run: Run) -> dict[str, Ledger]:
    """Return the books of a run by name, the first one's empty."""
    recording = record(run, simulate(run), 0.0, 0.0, {})
    first = actuator_ledger(recording)
    return {"": first, **further_ledgers(recording)}
