"""Trust study, which tests whether a method recovers known values from simulated experiments."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bywire.api import identification
from bywire.api.identification import ChosenMethod, choose
from bywire.core.libraries import on_one_thread
from bywire.core.typing import Progress, silent
from bywire.identification import trust as trusted
from bywire.identification.method import Effort
from bywire.identification.question import Question
from bywire.identification.trust import Trust
from bywire.report.answer import Answer
from bywire.report.answering import answering
from bywire.report.document import Document, Flat, Listing, Section, TableBlock
from bywire.report.estimate_tables import trust_table

STORE = "experiments.jsonl"
"""file in the output folder that stores finished experiments"""

_NONE: Mapping[str, Any] = MappingProxyType({})
_NOTHING = Question()
_MOST = 5  # maximum number of listed experiments without a result


@dataclass(frozen=True)
class TrustStudy(Answer):
    """Results of a method on many simulated experiments.

    Parameters
    ----------
    chosen
        The method with its parameters and options.
    trust
        Every experiment's outcome, and the recovery of each unknown.
    """

    chosen: ChosenMethod
    trust: Trust

    @property
    def holds(self) -> bool:
        """Whether the method recovers every unknown in every experiment."""
        return self.trust.holds

    @cached_property
    def troubles(self) -> list[str]:
        """Failed experiments, unknowns that were not determined, failed checks."""
        outcomes, failed = self.trust.outcomes, self.trust.failed
        texts = [f"seed {o.seed} gave no result: {o.error}" for o in failed[:_MOST]]
        if len(failed) > _MOST:
            texts.append(f"and {len(failed) - _MOST} more")
        kept = Counter(label for o in outcomes for label in o.kept)
        checks = Counter(name for o in outcomes for name in o.failed_checks)
        texts += [
            f"{label} was not determined in {n} of {len(outcomes)} experiments"
            for label, n in kept.items()
        ]
        texts += [
            f"check {name} failed in {n} of {len(outcomes)} experiments"
            for name, n in checks.items()
        ]
        return texts

    def document(self) -> Document:
        """Return the recovery of each unknown, and the failures."""
        method, trust = self.chosen.method, self.trust
        count = len(trust.outcomes)
        blocks = list(self._blocks())
        return Document(
            f"Trust in {method.name}",
            f"{count} simulated experiments, each with its own noise",
            sections=[Section("Recovery", blocks)],
            brief=[
                f"{method.name}: {count} simulated experiments, each with its own noise",
                *blocks,
            ],
            data={
                "method": method.name,
                "parameter_set": self.chosen.name or None,
                "options": self.chosen.options.model_dump(mode="json"),
                "seeds": [o.seed for o in trust.outcomes],
                "holds": trust.holds,
                "recovered": {
                    r.label: {k: v for k, v in asdict(r).items() if k != "label"}
                    | {"holds": r.holds}
                    for r in trust.recovered
                },
                "experiments": [asdict(o) for o in trust.outcomes],
            },
            record=identification.STUDY,
            prepare=lambda folder: identification.require_own(folder, method.name),
            is_paged=False,
            changes=self.chosen.changed,
        )

    def _blocks(self) -> Iterator[Flat]:
        if self.trust.recovered:
            yield TableBlock(trust_table(self.trust), f"{self.chosen.method.name}.")
        if self.troubles:
            yield Listing(self.troubles)


@answering
@on_one_thread()
def trust(
    method: str,
    count: int = 200,
    parameters: str = "",
    overrides: Mapping[str, Any] = _NONE,
    *,
    question: Question = _NOTHING,
    options: Mapping[str, Any] = _NONE,
    starts: int = 1,
    seed: int = 1,
    folder: str | Path | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
) -> TrustStudy:
    """Test a method on many simulated experiments, each with its own noise and perturbed start.

    Parameters
    ----------
    method, parameters, overrides, question, options
        See `bywire.identify`.
    count
        Number of experiments.
    starts, seed
        Number of starting points of each search, and the first experiment's seed. The other seeds
        follow it.
    folder
        Folder of the result. bywire rejects a folder with another method's result, and removes an
        earlier study. Finished experiments stay there, so that an interrupted study can continue.
    processes
        Number of experiments to run in parallel. Default: one per core.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    TrustStudy
        Recovery of the known values, with errors and intervals of each parameter in SI units.

    Raises
    ------
    InputError
        If an argument is invalid.
    KeyboardInterrupt
        If interrupted.
    """
    shown = silent if progress is None else progress
    chosen = choose(method, parameters, overrides, options, question, progress=shown)
    store = None
    if folder is not None:
        identification.require_own(Path(folder), method)
        identification.remove_study(Path(folder))
        store = Path(folder) / STORE
    try:
        recovered = trusted.trust(
            chosen.method,
            chosen.par,
            chosen.options,
            range(seed, seed + count),
            Effort(starts=starts),
            processes=processes,
            store=store,
            progress=shown,
        )
    except KeyboardInterrupt:
        if store is None or not store.exists():
            raise
        raise KeyboardInterrupt(
            f"finished experiments are saved in {store}. Rerun the command to continue"
        ) from None
    return TrustStudy(chosen, recovered)
