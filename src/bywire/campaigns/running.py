"""A campaign, run: what is missing is computed, fault by fault, and kept in a folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from bywire.bench.running import Progress
from bywire.campaigns.findings import CampaignFindings, finding
from bywire.campaigns.judging import healthy_traces, judge_fault, judge_healthy
from bywire.campaigns.plan import CampaignPlan
from bywire.cases.runner import complete
from bywire.cases.store import PieceFolder, json_object
from bywire.core.callers import option


@dataclass(frozen=True)
class CampaignStore(PieceFolder):
    """Where the outcomes of a campaign lie.

    Parameters
    ----------
    folder
        The campaign's folder.
    """

    NOUN = "campaign"
    KIND = "campaign of faults"
    COMMAND = "bywire faults"
    RECORD = "campaign.json"
    PIECES = "faults"
    FILE = "{:04d}.json"
    SAID: ClassVar[Mapping[str, type]] = {"digest": str, "campaign": dict}

    @property
    def elsewhere(self) -> str:
        """What to do where the folder holds another campaign."""
        return f"name another folder with {option('out')}, or remove it"

    def kept(self, plan: CampaignPlan) -> dict[int, dict[str, Any]]:
        """Return the outcomes of faults that are there, by number; a damaged one is not."""
        outcomes = {}
        for number in self.finished() & {*range(len(plan.faults))}:
            try:
                outcomes[number] = json_object(self.path(number).read_bytes())
                finding(plan, number, outcomes[number])
            except (OSError, ValueError, KeyError, TypeError, AttributeError):
                outcomes.pop(number, None)
        return outcomes

    def keep(self, number: int, outcome: dict[str, Any]) -> None:
        """Keep the outcome of a fault.

        Raises
        ------
        FileError
            When it cannot be written.
        """
        text = json.dumps(outcome) + "\n"
        self.keep_file(number, lambda fresh: fresh.write_text(text, encoding="utf-8"))


# --- The run


def run_campaign(
    plan: CampaignPlan, store: CampaignStore | None, progress: Progress
) -> CampaignFindings:
    """Return what a campaign finds, computed as far as its folder does not hold it.

    Parameters
    ----------
    plan, store
        The campaign and its folder; None keeps nothing.
    progress
        Called with the fault's name and the finished share, 0 to 1.

    Raises
    ------
    InputError
        When a fault cannot be put in, or the folder is another campaign's.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted; finished faults stay.
    """
    if store is not None:
        store.begin(plan, {"name": plan.name})
    progress("healthy runs", 0.0)
    healthy = judge_healthy(plan, healthy_traces(plan))
    # A few lanes each: faults side by side use the cores better than the runs of one.
    outcomes = complete(
        range(len(plan.faults)),
        {} if store is None else store.kept(plan),
        lambda number: judge_fault(plan, plan.faults[number], healthy),
        keep=(lambda *_: None) if store is None else store.keep,
        progress=lambda number, share: progress(plan.faults[number].name, share),
    )
    progress("judged", 1.0)
    findings = (finding(plan, k, outcomes[k]) for k in range(len(plan.faults)))
    return CampaignFindings(plan, healthy, tuple(findings))
