"""Whether a method gives back what is put into many simulated experiments."""

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
"""file of the output folder that keeps finished experiments"""

_NONE: Mapping[str, Any] = MappingProxyType({})
_NOTHING = Question()
_MOST = 5  # experiments without a result that are named one by one


@dataclass(frozen=True)
class TrustStudy(Answer):
    """What many simulated experiments say of a method.

    Parameters
    ----------
    chosen
        The method with its parameters and options.
    trust
        Every experiment's outcome, and how well each unknown comes back.
    """

    chosen: ChosenMethod
    trust: Trust

    @property
    def holds(self) -> bool:
        """Whether every unknown comes back, from every experiment."""
        return self.trust.holds

    @cached_property
    def troubles(self) -> list[str]:
        """What did not come back: experiments, unknowns that were not told, failed checks."""
        outcomes, failed = self.trust.outcomes, self.trust.failed
        texts = [f"seed {o.seed} gave nothing: {o.error}" for o in failed[:_MOST]]
        if len(failed) > _MOST:
            texts.append(f"and {len(failed) - _MOST} more")
        kept = Counter(label for o in outcomes for label in o.kept)
        checks = Counter(name for o in outcomes for name in o.failed_checks)
        texts += [f"{label} was not told in {n} of {len(outcomes)}" for label, n in kept.items()]
        texts += [f"check {name} failed in {n} of {len(outcomes)}" for name, n in checks.items()]
        return texts

    def document(self) -> Document:
        """Return how well each unknown comes back, and what did not."""
        method, trust = self.chosen.method, self.trust
        count = len(trust.outcomes)
        blocks = list(self._blocks())
        return Document(
            f"Trust in {method.name}",
            f"{count} simulated experiments, each with its own noise",
            sections=[Section("What comes back", blocks)],
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
    """Identify many simulated experiments, each with its own noise and from a start that is off.

    Parameters
    ----------
    method, parameters, overrides, question, options
        As of `bywire.identify`.
    count
        Number of experiments.
    starts, seed
        Starts of each search, and the first experiment's seed; the others follow it.
    folder
        Where the result will be written: a folder with the result of another method is refused, an
        earlier study is removed, and finished experiments are kept there, so that an interrupted
        study goes on.
    processes
        Experiments at a time; all cores by default.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    TrustStudy
        How far what was put in comes back: errors and intervals of each parameter, in SI units.

    Raises
    ------
    InputError
        When something that is asked for does not fit.
    KeyboardInterrupt
        When interrupted.
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
            f"finished experiments are in {store}: the same command goes on"
        ) from None
    return TrustStudy(chosen, recovered)
