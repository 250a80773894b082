"""A campaign, run: what is missing is computed, fault by fault, and kept in a folder."""

from __future__ import annotations

import json
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.bench.running import Progress
from bywire.campaigns.findings import CampaignFindings, finding
from bywire.campaigns.judging import healthy_traces, judge_fault, judge_healthy
from bywire.campaigns.plan import CampaignPlan
from bywire.core.callers import option
from bywire.core.errors import FileError
from bywire.core.interrupts import thread_pool
from bywire.core.scratch import replacing, sweep
from bywire.studies.plan import differing

RECORD, FAULTS = "campaign.json", "faults"


@dataclass(frozen=True)
class CampaignStore:
    """Where the outcomes of a campaign lie; each file is there as a whole or not at all.

    Parameters
    ----------
    folder
        The campaign's folder; None keeps nothing.
    """

    folder: Path | None

    def open(self, plan: CampaignPlan) -> None:
        """Make the folder that of a campaign, or refuse that of another.

        Raises
        ------
        FileError
            When it holds another campaign, or cannot be written.
        """
        if self.folder is None:
            return
        record = self.folder / RECORD
        try:
            if record.exists():
                self._require(plan, json.loads(record.read_text(encoding="utf-8")))
            (self.folder / FAULTS).mkdir(parents=True, exist_ok=True)
            sweep(self.folder / FAULTS)
            said = {"digest": plan.digest, "name": plan.name, "campaign": plan.identity}
            with replacing(record) as fresh:
                fresh.write_text(json.dumps(said, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise FileError(
                f"{self.folder} cannot be written ({error.strerror}): name another folder"
            ) from None
        except (ValueError, KeyError, TypeError):
            raise FileError(
                f"{record} is damaged, or not of a campaign: name another folder with "
                f"{option('out')}"
            ) from None

    def _require(self, plan: CampaignPlan, known: dict[str, Any]) -> None:
        if known["digest"] != plan.digest:
            differs = differing(known["campaign"], plan.identity)
            raise FileError(
                f"{self.folder} holds another campaign{differs and f' ({differs})'}: name another "
                f"folder with {option('out')}, or remove it"
            )

    def holds(self, plan: CampaignPlan) -> bool:
        """Return whether it is the folder of a campaign already."""
        if self.folder is None:
            return False
        try:
            known = json.loads((self.folder / RECORD).read_text(encoding="utf-8"))
            return bool(known["digest"] == plan.digest)
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def kept(self, number: int) -> dict[str, Any] | None:
        """Return the outcome of a fault; None where there is none, or its file is damaged."""
        if self.folder is None:
            return None
        try:
            outcome = json.loads(self._path(number).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return outcome if isinstance(outcome, dict) else None

    def keep(self, number: int, outcome: dict[str, Any]) -> None:
        """Keep the outcome of a fault.

        Raises
        ------
        FileError
            When it cannot be written.
        """
        if self.folder is None:
            return
        try:
            with replacing(self._path(number)) as fresh:
                fresh.write_text(json.dumps(outcome) + "\n", encoding="utf-8")
        except OSError as error:
            raise FileError(
                f"{self._path(number)} cannot be written ({error.strerror}): what is finished is "
                "kept"
            ) from None

    def _path(self, number: int) -> Path:
        assert self.folder is not None
        return self.folder / FAULTS / f"{number:04d}.json"


# --- The run


def complete(plan: CampaignPlan, store: CampaignStore, progress: Progress) -> CampaignFindings:
    """Return what a campaign finds, computed as far as its folder does not hold it.

    Parameters
    ----------
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
    store.open(plan)
    progress("healthy runs", 0.0)
    healthy = judge_healthy(plan, healthy_traces(plan))
    outcomes = {k: kept for k in range(len(plan.faults)) if (kept := store.kept(k)) is not None}
    missing = [k for k in range(len(plan.faults)) if k not in outcomes]

    # A few lanes each: faults side by side use the cores better than the runs of one.
    with thread_pool() as pool:
        made = {
            pool.submit(judge_fault, plan, plan.faults[number], healthy): number
            for number in missing
        }
        for future in as_completed(made):  # here alone files are written, one at a time
            number = made[future]
            outcomes[number] = future.result()
            store.keep(number, outcomes[number])
            progress(plan.faults[number].name, len(outcomes) / len(plan.faults))
    progress("judged", 1.0)
    findings = (finding(plan, k, outcomes[k]) for k in range(len(plan.faults)))
    return CampaignFindings(plan, healthy, tuple(findings))
