"""A campaign, run: what is missing is computed, fault by fault, and kept as it comes."""

from __future__ import annotations

from concurrent.futures import as_completed

from bywire.bench.running import Progress
from bywire.campaigns.findings import CampaignFindings, finding
from bywire.campaigns.judging import judge_fault, judge_healthy
from bywire.campaigns.plan import CampaignPlan
from bywire.campaigns.simulating import healthy_traces
from bywire.campaigns.store import CampaignStore
from bywire.core.interrupts import thread_pool


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
